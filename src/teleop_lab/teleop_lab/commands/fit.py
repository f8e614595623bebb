"""``teleop fit``: fit numbers of the hardware plant to measured rest positions of a machine."""

from pathlib import Path

from teleop_core.commands.options import ParameterOptions, Words


def fit(
    table: Path | None = None,
    /,
    *,
    robot: str = "rcrt1",
    free: Words = (),
    loss: str = "cauchy",
    json: Path | None = None,
    out: Path | None = None,
    changes: ParameterOptions = ParameterOptions(),
) -> None:
    """Fit friction, bias and weights of the hardware plant to where a machine came to rest.

    Without a table those of the RCRT-1's source are taken (ten runs to each of six points), with the gains that the
    numbers of the plant `hardware` were fitted with:

        teleop fit                                           # half a minute
        teleop fit --free coulomb.theta1 bias.theta1         # these alone
        teleop fit rests.csv --robot scara --out scara.yaml  # a machine of yours; then
        teleop sim --config scara.yaml --set robot=scara --out bags/predicted

    A table is a CSV with a row per run: point, target_<joint> and <joint> of every joint [rad or m]. What can be free:
    coulomb.<joint>, bias.<joint>, weight.<symbol>; `wander` follows from the spread.

    Args:
        table: CSV file of rest positions; without it, the published ones.
        robot: Robot of the table.
        free: Parameters to fit; without it, all that the table can identify.
        loss: Loss function, which limits the weight of outliers: cauchy, huber, soft_l1 or linear.
        json: Write all numbers as JSON.
        out: Write the fitted plant as a parameter file, for --config.
        changes: Values of parameters.
    """
    from json import dumps

    from teleop_core.commands.progress import shown_progress
    from teleop_core.evaluation.command import check_places
    from teleop_lab.fitting import fit_plant

    check_places(json, out)
    with shown_progress("fitting") as progress:
        found = fit_plant(
            table,
            robot=robot,
            free=free or None,
            files=changes.config,
            texts=changes.texts,
            loss=loss,
            progress=lambda share: progress(round(100.0 * share), 100),
        )
    print(found)
    if json is not None:
        json.write_text(dumps(found.to_json(), indent=1) + "\n", encoding="utf-8")
        print(f"numbers: {json}")
    if out is not None:
        out.write_text(found.parameter_file(), encoding="utf-8")
        print(f"parameters: {out}; take them with --config {out}")
