"""A study with the client that openapi-python-client generates: URL PROBLEM COEFFICIENT ..."""

import json
import sys

from client import Client
from client.api.jobs import create_job
from client.api.results import get_result
from client.models import Submission

url, file, *coefficients = sys.argv[1:]
client = Client(base_url=url)
problem = json.load(open(file))
for coefficient in coefficients:
    problem["contacts"][0]["friction"]["coefficient"] = float(coefficient)
    job = create_job.sync(client=client, body=Submission.from_dict({"problem": problem}), prefer="wait=30")
    print(get_result.sync(id=job.id, client=client).summary.normal_force)
