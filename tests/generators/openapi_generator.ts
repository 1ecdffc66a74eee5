// A study with the client that openapi-generator generates for TypeScript: URL PROBLEM COEFFICIENT ...
import { readFileSync } from "node:fs";
import { Configuration, JobsApi, ProblemFromJSON, ResultsApi } from "./index.js";

const [url, file, ...coefficients] = process.argv.slice(2);
const configuration = new Configuration({ basePath: url });
const text = readFileSync(file, "utf8");
for (const coefficient of coefficients) {
  const problem = ProblemFromJSON(JSON.parse(text));
  problem.contacts![0].friction!.coefficient = Number(coefficient);
  const job = await new JobsApi(configuration).createJob({ submission: { problem }, prefer: "wait=30" });
  const result = await new ResultsApi(configuration).getResult({ id: job.id });
  console.log(result.summary.normalForce);
}
