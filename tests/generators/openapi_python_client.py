"""A study with the client that openapi-python-client generates: URL PROBLEM COEFFICIENT ..."""

import json
import sys

from client import Client
from client.api.jobs import count_jobs, create_job
from client.api.results import get_result
from client.models import CountJobsLabelKey, Submission

url, file, *coefficients = sys.argv[1:]
client = Client(base_url=url)
problem = json.load(open(file))
for coefficient in coefficients:
    problem["contacts"][0]["friction"]["coefficient"] = float(coefficient)
    job = create_job.sync(client=client, body=Submission.from_dict({"problem": problem}), prefer="wait=30")
    print(get_result.sync(id=job.id, client=client).summary.normal_force)

# a filter by label is sent: left out, it would match every job, in a bulk deletion too
by_label = count_jobs.sync(client=client, label_key=CountJobsLabelKey.from_dict({"label.study": "nobody's"}))
assert by_label.to_dict()["total"] == 0, by_label
