"""One idempotency key, one job: many clients send the same, at once, while the server is killed (R20).

    keys.py [KEYS] [SEED]

Twenty clients post the same body under each key, all keys in random order, and repeat what was not
answered; in the middle the server is killed.
"""

import asyncio
import collections
import pathlib
import random
import sys

sys.path.insert(0, str(pathlib.Path(__file__).resolve().parent.parent))

import outside
from outside import Connection, Lost, Server, check, each, equal, example, submission

KEYS = int(sys.argv[1]) if len(sys.argv) > 1 else 1000
SEED = int(sys.argv[2]) if len(sys.argv) > 2 else random.randrange(1 << 32)
CLIENTS = 20
# so many keys are in the air at the same time
LANES = 4


async def post(server, dice):
    """Gives for each key the id and whether it was replayed, of each answer; and the keys that the kill met."""
    answers, disturbed, halfway = collections.defaultdict(list), set(), asyncio.Event()
    left = [KEYS * CLIENTS]
    body = {key: submission(example(), name="key %d" % key) for key in range(KEYS)}
    # a lane of keys for each group of clients, in one order: those who share a key are at it together
    keys = dice.sample(range(KEYS), KEYS)
    lanes = [keys[lane::LANES] for lane in range(LANES)]

    async def client(place):
        connection = Connection(server)
        for key in lanes[place % LANES]:
            while True:
                try:
                    answer = await connection.call("POST", "/v1/jobs", body[key], idempotency_key="key-%d" % key)
                    break
                except Lost:
                    disturbed.add(key)
                    await asyncio.sleep(0.02)
            check(answer.status in (200, 201, 202), "post under a key, %r" % answer)
            answers[key].append((answer.json()["id"], answer.headers.get("idempotency-replayed") == "true"))
            left[0] -= 1
            if left[0] * 2 <= KEYS * CLIENTS:
                halfway.set()
        connection.close()

    async def kill():
        await halfway.wait()
        server.kill()
        await asyncio.get_running_loop().run_in_executor(None, server.start)

    await asyncio.gather(each(range(CLIENTS * LANES), client), kill())
    return answers, disturbed


def main():
    print("seed %d" % SEED, flush=True)
    with Server() as server:
        answers, disturbed = asyncio.run(post(server, random.Random(SEED)))
        check(disturbed, "the kill met no request")
        for key, given in answers.items():
            equal(len(given), CLIENTS, "the number of answers under key %d" % key)
            equal(len({job for job, _ in given}), 1, "the number of jobs under key %d" % key)
            first = sum(not replayed for _, replayed in given)
            # the answer that told of the new job may have been lost with the server
            check(first == 1 or first == 0 and key in disturbed, "%d answers under key %d are no replays" % (first, key))
        jobs = {given[0][0] for given in answers.values()}
        equal(len(jobs), KEYS, "the number of jobs that the answers name")
        listed = server.every_job()
        equal({job["id"] for job in listed}, jobs, "the jobs in the list")
        equal(len(listed), KEYS, "the number of jobs in the list")
        # a key outlives another restart, and stands for its first body
        other = submission(example(), name="another")
        server.kill()
        server.start()
        answer = server.call("POST", "/v1/jobs", other, idempotency_key="key-0")
        equal((answer.status, answer.json().get("code")), (422, "idempotency-key-reuse"), "another body under the same key")
    firsts = sum(not replayed for given in answers.values() for _, replayed in given)
    print("%d keys × %d clients: %d jobs, %d answers agree, %d of them first ones; the kill met %d keys; %d checks" % (
        KEYS, CLIENTS, len(jobs), sum(map(len, answers.values())), firsts, len(disturbed), outside.checks))


main()
