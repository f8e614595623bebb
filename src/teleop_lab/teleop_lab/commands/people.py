"""``teleop people``: a study with people at the console; their scores are compared with the simulated operator's."""

import argparse
import webbrowser
from contextlib import suppress
from typing import Any

from teleop_core.base.errors import ParameterError
from teleop_core.commands.arguments import command, ros_module
from teleop_lab.commands.outputs import add_study, check_outputs, write_outputs

_EPILOG = """\
a study is a YAML file, as of `teleop study`, with an entry `people`; then:
  teleop people late.yaml --store late             opens the participant's page; prints the conductor's
  teleop people late.yaml --store late             ended and called again, it goes on where it was
  teleop people late.yaml --store late --compare   scores beside those of the simulated operator
  teleop people late.yaml --store late --compare --html late.html --csv late.csv
"""


def add(commands: Any) -> None:
    """Add the command's parser."""
    text = "conduct a study with people in the browser, and compare them with the simulated operator"
    parser = command(commands, "people", _run, text, _EPILOG)
    add_study(
        parser,
        "YAML file of the study: its conditions, trials and participants",
        "trial",
        ", of --compare",
        must_keep=True,
    )
    parser.add_argument("--port", type=int, default=8080, help="port of the pages (default: 8080)")
    parser.add_argument(
        "--host", default="127.0.0.1", help="network address of the pages (default: reachable from this machine only)"
    )
    parser.add_argument(
        "--token", default="", help="secret that opens the pages (default: a new one with --host, else none)"
    )
    parser.add_argument("--no-browser", action="store_true", help="open no browser")
    parser.add_argument(
        "--compare",
        action="store_true",
        help="run the simulated operator and compare it with the people's answers; conduct no trials",
    )


def _run(arguments: argparse.Namespace) -> int:
    from teleop_lab.people.journal import Journal
    from teleop_lab.people.plan import read_plan

    plan = read_plan(arguments.file)
    check_outputs(arguments)
    if not arguments.compare and (arguments.html or arguments.csv):
        raise ParameterError("--html and --csv", True, "given with --compare")
    journal = Journal(arguments.store, plan)
    if arguments.compare:
        return _compare(arguments, plan, journal)
    ros_module("guest")
    from teleop_lab.people.conduct import conduct, serve

    server, page = serve(plan, journal, arguments.port, arguments.host, arguments.token)
    with server:
        print(f"participants: {server.url}; Ctrl-C ends it", flush=True)
        print(f"who conducts: {page.link(server.url)}", flush=True)
        if not arguments.no_browser and not webbrowser.open(server.url):
            print("there is no browser here: open these addresses in one", flush=True)
        with suppress(KeyboardInterrupt):
            conduct(server, page, plan, journal)
    return 0


def _compare(arguments: argparse.Namespace, plan: Any, journal: Any) -> int:
    import pandas

    from teleop_core.commands.progress import shown_progress
    from teleop_lab.people.compare import comparison_page, comparison_table, people_dataset

    people = people_dataset(plan, journal)
    with shown_progress("simulated operator") as progress:
        simulated = plan.study.run(arguments.store / "simulated", jobs=arguments.jobs, progress=progress)
    print(comparison_table(plan, people, simulated))
    rows = pandas.DataFrame(journal.rows())
    write_outputs(arguments, lambda: rows.to_csv(index=False), lambda: comparison_page(plan, people, simulated))
    return 0
