/** Addresses of views: what is behind `#`, such as `#/jobs?status=running`. */

/**
 * @typedef {object} Route
 * @property {string[]} path such as ["jobs", "job_…"]
 * @property {URLSearchParams} query
 */

/** @param {string} part of an address, which a person may have typed */
function decoded(part) {
  try {
    return decodeURIComponent(part);
  } catch {
    return part;
  }
}

/** @returns {Route} the present one */
export function route() {
  const [path = "", query = ""] = location.hash.replace(/^#\/?/, "").split("?");
  return { path: path.split("/").filter(Boolean).map(decoded), query: new URLSearchParams(query) };
}

/**
 * The address of a view.
 * @param {string} path such as jobs/job_…
 * @param {URLSearchParams | Record<string, string>} [query]
 */
export function address(path, query) {
  const text = new URLSearchParams(query).toString();
  return `#/${path}${text ? `?${text}` : ""}`;
}

/**
 * Goes to a view.
 * @param {string} to as `address` gives it
 * @param {{replace?: boolean}} [how] whether the present view is left out of the way back
 */
export function go(to, { replace = false } = {}) {
  if (replace) {
    history.replaceState(null, "", to);
    dispatchEvent(new HashChangeEvent("hashchange"));
  } else {
    location.hash = to;
  }
}
