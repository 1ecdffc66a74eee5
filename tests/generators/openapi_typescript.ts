// A study with the types that openapi-typescript generates: URL PROBLEM COEFFICIENT ...
import { readFileSync } from "node:fs";
import createClient from "openapi-fetch";
import type { components, paths } from "./api.js";

const [url, file, ...coefficients] = process.argv.slice(2);
const client = createClient<paths>({ baseUrl: url });
const problem: components["schemas"]["Problem"] = JSON.parse(readFileSync(file, "utf8"));
for (const coefficient of coefficients) {
  problem.contacts![0].friction!.coefficient = Number(coefficient);
  const { data: job } = await client.POST("/v1/jobs", { body: { problem }, params: { header: { Prefer: "wait=30" } } });
  // it would be a text if Accept asked for a stream of events
  if (!job || typeof job === "string") throw new Error("the answer is not a job");
  const { data: result } = await client.GET("/v1/jobs/{id}/result", { params: { path: { id: job.id } } });
  console.log(result!.summary.normal_force);
}
