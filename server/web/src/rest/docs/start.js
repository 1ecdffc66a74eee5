// Everything comes from this service; nothing is asked of anybody else (validatorUrl would be).
SwaggerUIBundle({
  url: "openapi.json",
  dom_id: "#api",
  deepLinking: true,
  docExpansion: "list",
  defaultModelsExpandDepth: 0,
  validatorUrl: null,
  // what reads comes before what changes, and deleting many comes last
  operationsSorter: (a, b) => {
    const rank = (operation) =>
      ["get", "post", "put", "patch", "delete"].indexOf(operation.get("method"));
    const path = (operation) => operation.get("path");
    return rank(a) - rank(b) || path(a).localeCompare(path(b));
  },
});
