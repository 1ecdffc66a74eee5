"""A study with the client that openapi-generator generates for Python: URL PROBLEM COEFFICIENT ..."""

import json
import sys

import openapi_client as api

url, file, *coefficients = sys.argv[1:]
client = api.ApiClient(api.Configuration(host=url))
problem = json.load(open(file))
for coefficient in coefficients:
    problem["contacts"][0]["friction"]["coefficient"] = float(coefficient)
    job = api.JobsApi(client).create_job(api.Submission.from_dict({"problem": problem}), prefer="wait=30")
    print(api.ResultsApi(client).get_result(job.id).summary.normal_force)
