"""``teleop people``: a study with people at the console; their scores are compared with the simulated operator's."""

import webbrowser
from contextlib import suppress
from pathlib import Path
from typing import Annotated, Any

from cyclopts import Parameter

from teleop_core.base.errors import ParameterError
from teleop_core.commands.options import ros_module
from teleop_lab.commands.outputs import Outputs


def people(
    file: Annotated[Path, Parameter(name="FILE.yaml")],
    /,
    *,
    store: Path,
    port: int = 8080,
    host: str = "127.0.0.1",
    token: str = "",
    no_browser: bool = False,
    compare: bool = False,
    outputs: Outputs = Outputs(),
) -> None:
    """Conduct a study with people in the browser, and compare them with the simulated operator.

    A study is a YAML file, as of `teleop study`, with an entry `people`; then:

        teleop people late.yaml --store late            # opens the participant's page; prints the conductor's
        teleop people late.yaml --store late            # ended and called again, it goes on where it was
        teleop people late.yaml --store late --compare  # scores beside those of the simulated operator
        teleop people late.yaml --store late --compare --html late.html --csv late.csv

    Args:
        file: YAML file of the study: its conditions, trials and participants.
        store: Directory that keeps recordings and answers.
        port: Port of the pages.
        host: Network address of the pages; by default they are reachable from this machine only.
        token: Secret in the pages' addresses, without which nothing is answered; by default a new one.
        no_browser: Open no browser.
        compare: Run the simulated operator and compare it with the people's answers; conduct no trials.
        outputs: Files with the trials, of --compare.
    """
    from teleop_lab.people.journal import Journal
    from teleop_lab.people.plan import read_plan

    plan = read_plan(file)
    outputs.check()
    if not compare and (outputs.html or outputs.csv):
        raise ParameterError("--html and --csv", True, "given with --compare")
    journal = Journal(store, plan)
    if compare:
        _compare(store, plan, journal, outputs)
        return
    ros_module("guest")
    from teleop_lab.people.conduct import conduct, serve

    server, page = serve(plan, journal, port, host, token)
    with server:
        print(f"participants: {server.url}; Ctrl-C ends it", flush=True)
        print(f"who conducts: {page.link(server.url)}", flush=True)
        if not no_browser and not webbrowser.open(server.url):
            print("there is no browser here: open these addresses in one", flush=True)
        with suppress(KeyboardInterrupt):
            conduct(server, page, plan, journal)


def _compare(store: Path, plan: Any, journal: Any, outputs: Outputs) -> None:
    import pandas

    from teleop_core.commands.progress import shown_progress
    from teleop_lab.people.compare import comparison_page, comparison_table, people_dataset

    found = people_dataset(plan, journal)
    with shown_progress("simulated operator") as progress:
        simulated = plan.study.run(store / "simulated", jobs=outputs.jobs, progress=progress)
    print(comparison_table(plan, found, simulated))
    rows = pandas.DataFrame(journal.rows())
    outputs.write(lambda: rows.to_csv(index=False), lambda: comparison_page(plan, found, simulated))
