"""Streams of events that are cut at random and resumed, while jobs run, after they have ended, and
across kills of the server: each client must see 1 … N, once each, and all clients the same (R10).

    cut_streams.py [SEED]

Server-sent events are cut at any byte of the response, in the middle of its head, of a chunk or of a
line; gRPC streams after any number of messages.
"""

import asyncio
import json
import pathlib
import random
import sys
import threading

sys.path.insert(0, str(pathlib.Path(__file__).resolve().parent.parent))

import grpc

import outside
from outside import Server, check, equal, talkative
from reflected import Client, as_json

SEED = int(sys.argv[1]) if len(sys.argv) > 1 else random.randrange(1 << 32)
SSE_CUTS, GRPC_CUTS = 1000, 200
KILLS = 3
# enough for a few tens of events, so that a job takes a few tens of connections
MOST_BYTES, MOST_MESSAGES = 30_000, 60
INCREMENTS = 250


def dechunked(body):
    """What has arrived of a chunked body; its last chunk may be incomplete."""
    pieces = []
    while True:
        size, found, rest = body.partition(b"\r\n")
        if not found:
            return b"".join(pieces)
        size = int(size, 16)
        pieces.append(rest[:size])
        body = rest[size + 2:]
        if len(rest) < size + 2:
            return b"".join(pieces)


def events_of(response):
    """Status and complete events of as much of a response as has arrived."""
    head, found, body = response.partition(b"\r\n\r\n")
    if not found:
        return None, []
    if b"transfer-encoding: chunked" in head.lower():
        body = dechunked(body)
    events = []
    # what follows the last empty line is half an event, which a client throws away
    for block in body.split(b"\n\n")[:-1]:
        fields = dict(line.split(b": ", 1) for line in block.split(b"\n") if not line.startswith(b":"))
        if fields:
            events.append((int(fields[b"id"]), fields[b"event"].decode(), fields[b"data"].decode()))
    return int(head.split(b" ", 2)[1]), events


class Told:
    """What has been told of each job so far, by whomever. Nobody may be told anything else."""

    def __init__(self):
        self.lines, self.lock = {}, threading.Lock()

    def hear(self, job, seq, line):
        with self.lock:
            lines = self.lines.setdefault(job, [])
            check(seq <= len(lines) + 1, "event %d of %s came before event %d" % (seq, job, len(lines) + 1))
            if seq == len(lines) + 1:
                lines.append(line)
            equal(line, lines[seq - 1], "event %d of %s, told again" % (seq, job))


async def cut_response(server, path, headers, most_bytes, most_s, abrupt):
    """Asks, reads so many bytes or so long, and hangs up. Gives what has arrived, and whether it was cut."""
    host, port = server.address.split(":")
    reader, writer = await asyncio.open_connection(host, int(port))
    response, end = b"", asyncio.get_running_loop().time() + most_s
    try:
        lines = ["GET %s HTTP/1.1" % path, "host: " + server.address, "accept: text/event-stream", *headers, "", ""]
        writer.write("\r\n".join(lines).encode())
        while len(response) < most_bytes:
            left = end - asyncio.get_running_loop().time()
            piece = await asyncio.wait_for(reader.read(most_bytes - len(response)), max(0, left))
            if not piece:
                return response, False
            response += piece
    except (asyncio.TimeoutError, ConnectionError):
        pass
    finally:
        # with a reset, or in good order
        writer.transport.abort() if abrupt else writer.close()
    return response, True


async def follow(server, job, told, dice, count):
    """One client of server-sent events: cut, resumed, until it has heard `done`."""
    seen, done = 0, False
    while not done:
        abrupt = dice.random() < 0.5
        path, headers = "/v1/jobs/%s/events" % job, []
        if seen and dice.random() < 0.7:
            headers = ["last-event-id: %d" % seen]
        elif seen:
            path += "?after_seq=%d" % seen
        try:
            most = dice.randrange(MOST_BYTES), dice.uniform(0.05, 1)
            response, cut = await cut_response(server, path, headers, *most, abrupt)
        except OSError:
            # killed, and not yet back
            await asyncio.sleep(0.02)
            continue
        count["cuts"] += cut
        status, events = events_of(response)
        check(status in (None, 200), "events of %s after %d were answered with %r" % (job, seen, response[:300]))
        for seq, kind, line in events:
            equal(seq, seen + 1, "the event that follows %d of %s" % (seen, job))
            data = json.loads(line)
            equal((data["seq"], data["type"]), (seq, kind), "the id and type of an event")
            told.hear(job, seq, line)
            seen, done = seq, kind == "done"
            check(not done or data["job"]["id"] == job, "done carries another job")
        if done:
            check(events[-1][0] == seen, "something follows done")
    equal(seen, len(told.lines[job]), "the number of events of %s" % job)


async def cut_server_sent_events(server, dice):
    """Clients of finished and of running jobs, several to each, until there were enough cuts."""
    told, count = Told(), {"cuts": 0}
    short = server.submit(talkative(20))
    server.finished(short)
    kills = 0
    while count["cuts"] < SSE_CUTS:
        running = [server.submit(talkative(INCREMENTS, refine=3)) for _ in range(2)]
        clients = [follow(server, job, told, dice, count) for job in [*running, *running, short, *told.lines]]
        clients = asyncio.gather(*clients)
        starts = 1
        if kills < KILLS:
            # in the middle of both
            while min(len(told.lines.get(job, [])) for job in running) < 50 + dice.randrange(200):
                await asyncio.wait([clients], timeout=0.01)
                if clients.done():
                    clients.result()
            server.kill()
            kills, starts = kills + 1, 2
            server.start()
        await clients
        for job in running:
            equal(json.loads(told.lines[job][-1])["attempt"], starts, "the starts of " + job)
    for job, lines in told.lines.items():
        replay = server.call("GET", "/v1/jobs/%s/events" % job, accept="text/event-stream")
        _, events = events_of(b"HTTP/1.1 200 OK\r\n\r\n" + replay.body)
        equal([line for _, _, line in events], lines, "the replay of " + job)
        equal([seq for seq, _, _ in events], list(range(1, len(lines) + 1)), "the numbers of " + job)
        equal([kind for _, kind, _ in events].count("done"), 1, "the number of ends of " + job)
        past = server.call("GET", "/v1/jobs/%s/events" % job, last_event_id=str(len(lines)))
        equal(past.status, 204, "the answer to somebody who has heard everything")
    return count["cuts"], kills, {job: len(lines) for job, lines in told.lines.items()}


def cut_grpc(server, jobs, dice):
    """The same by WatchJob, one client after the other; the server is killed under the first."""
    cuts, told, running = 0, Told(), server.submit(talkative(INCREMENTS, refine=3))
    killed = False
    client = Client(server.address)
    jobs = [running, *jobs]
    while cuts < GRPC_CUTS:
        job, seen, done = jobs[0], 0, False
        jobs = jobs[1:] + jobs[:1]
        while not done:
            most = dice.randrange(1, MOST_MESSAGES)
            stream = client.WatchJob(id=job, after_seq=seen)
            try:
                for event in stream:
                    equal(event.seq, seen + 1, "the event that follows %d of %s" % (seen, job))
                    seen, kind = event.seq, event.WhichOneof("payload")
                    told.hear(job, seen, json.dumps(as_json(event), sort_keys=True))
                    done, most = kind == "done", most - 1
                    if most == 0:
                        break
                cuts += not done
                check(done or most == 0, "a stream of %s ended before done, after %d" % (job, seen))
            except grpc.RpcError as error:
                check(killed and error.code().name == "UNAVAILABLE", "WatchJob ended with %r" % error)
            finally:
                stream.cancel()
            if job == running and not killed and seen > 100:
                killed = True
                server.kill()
                server.start()
                client.channel.close()
                client = Client(server.address)
        equal(seen, len(told.lines[job]), "the number of events of %s" % job)
    client.channel.close()
    return cuts


def main():
    print("seed %d" % SEED, flush=True)
    dice = random.Random(SEED)
    with Server() as server:
        cuts, kills, jobs = asyncio.run(cut_server_sent_events(server, dice))
        grpc_cuts = cut_grpc(server, list(jobs)[:3], dice)
    print("%d checks" % outside.checks)
    print("figure: server-sent events: %d cuts, %d kills of the server, %d jobs with %s events, each once; WatchJob: %d cuts, "
          "1 kill, each event once" % (cuts, kills, len(jobs), " + ".join(map(str, jobs.values())), grpc_cuts))


main()
