"""The promises R1 to R36 of the service under faults and attacks: one row each, with the command that shows it.

`run.py` runs the commands and writes docs/reliability.md. A row without a command is not shown yet, and says why.
"""

from typing import NamedTuple


class Row(NamedTuple):
    name: str
    promise: str
    # Run by tests/run (with --all if there are `needs`), in at most a minute; a Python script lies in this folder.
    small: str = ""
    # Run by tests/soak, for as long as it takes.
    soak: str = ""
    # What of the promise no command shows, and why.
    missing: str = ""
    # What an attack on an earlier version found, which did not keep the promise.
    before: str = ""
    # Programs that the small form needs beyond a C compiler and Python: `tests/run` alone leaves such rows to `tests/run --all`.
    needs: tuple[str, ...] = ()


ROWS = [
    Row("R1", "Killed again and again under load: no acknowledged job is lost or doubled, each ends, the database is whole",
        "kills.py", "kills.py 1000"),
    Row("R2", "Power loss: a submit is answered only after its job is on the disk, and survives whatever else the disk lost",
        "power.py", "power.py --soak"),
    Row("R2a", "The order of system calls behind a submit: read, logged, synced, answered", "durable.py", "durable.py", needs=("strace",)),
    Row("R3", "The n-th write, sync, opening or reading of a file fails, for every n: a clean error or success, and the next job runs",
        "io_errors.py", "io_errors.py --soak"),
    Row("R4", "A panic or an error at every boundary of a job's stages costs that job only", "unit.py failpoints", "unit.py failpoints"),
    Row("R5", "A full disk: 507 within a second, reads and control verbs work, and everything works again when there is space",
        "full.py", "full.py --soak",
        before="a store that had filled its disk stayed full when all of it was deleted, and meshes could not be deleted at all; a cancel was answered with `cancel_requested` and the job succeeded later; delete, pause and the cancel of a job in the queue were refused with 507",
        needs=("unshare", "nsenter")),
    Row("R6", "A damaged database: no wrong data are returned, and intact jobs can be salvaged", "corrupt.py", "corrupt.py --soak",
        before="138 of 200 corruptions served something changed, such as a force of 97.65 for 96.65 with status 200; with a deleted log or an emptied database it started with jobs missing"),
    Row("R6a", "A changed bit in any table or index: no existing job is reported as missing, nothing is removed, and no submit creates a second job",
        "absent.py", "absent.py --soak",
        before="lists by a label were empty, a mesh was not found, a repeated submit made a second job, and a changed time in an index set the clock, by which all jobs were removed as too old"),
    Row("R7", "The clock jumps: no negative time, nothing ends early or late, lists stay in order",
        "clock.py", "clock.py --soak",
        before="an hour ahead expired jobs in the queue and told `run_s` 3607; an hour back listed the newest job last",
        needs=("faketime",)),
    Row("R8", "Clients that disconnect at any point leave no open files or memory behind, and cancel no job",
        "connections.py", "connections.py --soak",
        needs=("prlimit", "openssl")),
    Row("R9", "Hundreds of watchers: beside slow ones a solve takes no longer, beside as many quick ones at most a quarter longer; thousands who wait are soon answered",
        "watchers.py", "watchers.py --soak",
        before="200 slow watchers made a solve 4 times as long; 10,000 watchers of one end wrote 6,800 warnings"),
    Row("R10", "Streams that are cut and resumed have each event exactly once",
        "../clients/cut_streams.py", "../clients/cut_streams.py"),
    Row("R11", "Bodies that are too large, lie about their size or never end are refused at once",
        "transfers.py", "transfers.py --soak",
        before="100 connections held 16 MiB each; a batch of 1 MiB over gRPC took 1.0 GiB; 50 slow downloads took 343 MiB, 100 streams that nobody read 619 MiB"),
    Row("R12", "Compressed bodies are never unpacked beyond the limits, and files that are archives not at all",
        "compressed.py", "compressed.py --soak"),
    Row("R13", "Hostile JSON is refused at the cost of reading it", "bodies.py", "bodies.py --soak",
        before="15.7 MiB of `[]` took 3.0 GiB and 27 CPU s, four at once 9.2 GiB, and others waited for 156 s"),
    Row("R13a", "Hostile decks and mesh files cost no more than they contain", "decks.py", "decks.py --soak",
        before="0.88 MiB of sets of nodes took 3.8 GiB and 58 CPU s; 76 KB of sets that name each other 7 CPU s"),
    Row("R14", "Requests that stop half-way are closed in time, and other clients are not delayed",
        "connections.py", "connections.py --soak",
        before="after 75 s none of 4,000 connections was closed",
        needs=("prlimit", "openssl")),
    Row("R14a", "Behind nginx and Caddy as documented: events at once, streams resume, 512 MiB and long waits pass, links lead back",
        "proxy.py", "proxy.py --soak",
        needs=("nginx", "caddy", "openssl")),
    Row("R15", "More connections than open files allowed: other clients are answered, and the service recovers when the connections close",
        "connections.py", "connections.py --soak",
        before="1,000 idle connections kept everybody else out",
        needs=("prlimit", "openssl")),
    Row("R16", "Floods of HTTP/2 frames end their connection", "floods.py", "floods.py --soak",
        before="none of the floods ended its connection"),
    Row("R17", "Jobs that need more memory than there is are refused, or fail alone", "memory.py", "memory.py --soak",
        before="a body of 35 KB ended the process: 103 MiB were estimated; a contact of 4,000 nodes took 2,496 MiB of an estimate of 67; 1,000 load steps took 2.5 times their estimate"),
    Row("R17c", "Small requests whose parts multiply (contacts × steps × members × labels × requests at once) take no more memory than estimated",
        "multiply.py", "multiply.py --soak",
        before="a pointer of 15 MiB took 58 times its size, and three ended a process of 1 GiB; 60 contacts × 1,000 steps took 3.5 times their estimate; a table of 10,000 members took 1.9 GiB"),
    Row("R17b", "Estimates of long contacts lie between what they take and three times that", soak="unit.py long_contacts"),
    Row("R17a", "A worker is free a second after its job has ended by time or was canceled", "stuck.py", "stuck.py --soak",
        before="the next job waited for 74 s (2,000 contact nodes) and 250 s (3,000); 9 to 13 s with 500 contacts or 1,000 load steps of 60, 88 s with 1,000"),
    Row("R18", "Stopped again and again under load: nothing is lost, streams resume", "stops.py", "stops.py --soak"),
    Row("R18c", "systemd is notified when the service is ready and when it stops; the watchdog is notified only while the store answers",
        "systemd.py", "systemd.py --soak"),
    Row("R18a", "An unread log and signals that would end a process do not stop the work", "logs.py", "logs.py --soak",
        before="after 97 submits with an unread log nobody was answered; SIGHUP and SIGXFSZ ended the process",
        needs=("prlimit",)),
    Row("R18b", "One cancel or deletion of very many jobs is done in seconds, while others are answered", "bulk.py", "bulk.py --soak",
        before="97,704 cancels took 411 s, 20,000 deletions 66 s"),
    Row("R19", "A job canceled at any time ends once, and soon", "cancels.py 3000", "cancels.py"),
    Row("R20", "One idempotency key creates one job, however often and by whichever client it is sent", "keys.py", "keys.py"),
    Row("R21", "With --isolation process, a job that kills its worker costs only itself", "poison.py", "poison.py --soak",
        before="a solver that ends its process ended the service and every job that ran"),
    Row("R22", "Queue, store and clock simulated with seeded faults keep every promise", "unit.py simulation 300", "unit.py simulation 100000"),
    Row("R23", "Thousands of jobs of one owner do not hold up another: owners take turns", "shares.py", "shares.py --soak",
        before="a user's 2,000 jobs put the next user's first one at position 1987"),
    Row("R24", "An endless series of jobs, with retention on: memory, files, the database and times stay flat, and space is given back",
        "retention.py", "retention.py --soak"),
    Row("R25", "Pages of lists of a million jobs of 20 owners are read within 10 ms, and the service is ready within 2 s",
        "lists.py", "lists.py --soak", missing="the jobs were canceled in the queue: they have two events each, not 50"),
    Row("R26", "A thousand submits a second", missing="measured in docs/performance.md; not yet at this rate"),
    Row("R27", "Random and mutated input of every parser: no panic, no hang", "fuzz.py", "fuzz.py --soak 1"),
    Row("R28", "Thousands of calls made from the description of the API are answered as described",
        "../contract.py", "../contract.py"),
    Row("R29", "The 22 checks of UM-Bridge's protocol pass, and its Python package gets the numbers of jobs, bit by bit",
        "../clients/umbridge.py", "../clients/umbridge.py"),
    Row("R30", "Stores of every earlier version are upgraded, also if the upgrade is killed; stores of a later version are refused",
        "upgrades.py", "upgrades.py --soak",
        missing="there is no release yet: the older stores are made from the migrations, not by the programs of that time"),
    Row("R31", "A backup made under load has everything acknowledged before it, and is restored unchanged; an incomplete backup never looks complete",
        "backups.py", "backups.py --soak"),
    Row("R31a", "With Litestream beside it, a lost machine costs at most the last second of what was acknowledged",
        "litestream.py", "litestream.py --soak"),
    Row("R32", "Every route and rpc with every kind of token does what the policy says, and no token is in the log",
        "service.py auth", "service.py auth",
        before="any page that a user opened could pause the queue, cancel and delete: there was one user, an administrator"),
    Row("R33", "Two servers on one store, folders and ports that cannot be used: refused at once, with the reason",
        "starts.py", "starts.py --soak",
        before="with the file `lock` removed a second server was let in, and one on the same database by a hard link"),
    Row("R34", "The same problem has the same digest, on any thread, after a restart, from the cache",
        missing="tested for a few problems in the unit and service tests; not a hundred times"),
    Row("G9", "Over all these attacks no server takes more memory than the budget of its jobs and 256 MiB", "peaks.py", "peaks.py --soak"),
    Row("R35", "A page in a browser re-attaches after a restart", "page.py", "page.py", needs=("chromium",)),
    Row("R36", "Workers on other machines that are killed or cut off, and a service that is killed under them: no job is lost or ends twice",
        "workers.py", "workers.py --soak"),
    Row("R37", "Workers that break the contract or speak for others: refused, nothing stored, and told", "service.py hostile_worker",
        "service.py hostile_worker"),
    Row("R38", "10,000 jobs on eight nodes of Slurm while pilots, nodes, the service and the controller are killed: each ends once, a lost one "
        "runs again within a minute", soak="../slurm.py --soak", needs=("slurmctld", "munged")),
]
