"""Constants as a tidy table: one row a motor and constant, the unit in a column of its own."""

from __future__ import annotations

import io
from collections.abc import Iterable, Sequence
from typing import Any

import polars as pl

from pipeline.records.datasheet import Datasheet
from pipeline.records.estimate import Estimate, not_identifiable
from pipeline.records.uncertainty import type_a


def texts(names: str) -> dict[str, Any]:
    """Columns of text.

    Parameters
    ----------
    names
        With blanks between.

    """
    return dict.fromkeys(names.split(), pl.String)


def numbers(names: str) -> dict[str, Any]:
    """Columns of numbers.

    Parameters
    ----------
    names
        With blanks between.

    """
    return dict.fromkeys(names.split(), pl.Float64)


CONSTANT_SCHEMA = {
    **texts("motor_id motor_type lot constant"),
    "value": pl.Float64,
    "unit": pl.String,
    **numbers("u u_a u_b dof low_95 high_95"),
    **texts("status method"),
    "captures": pl.List(pl.String),
    "note": pl.String,
}


def constant_rows(
    motor_id: str, motor_type: str | None, lot: str | None, estimates: Iterable[Estimate]
) -> list[dict[str, Any]]:
    """One row an estimate; value, uncertainty and interval are null where it is not identifiable.

    `dof` is null where it is infinite.

    Parameters
    ----------
    motor_id
        The motor.
    motor_type
        Type of the motor.
    lot
        Lot of the motor.
    estimates
        The estimates.

    """
    rows = []
    for one in estimates:
        low, high = one.interval() if one.known else (None, None)
        own: dict[str, Any] = {
            "motor_id": motor_id,
            "motor_type": motor_type,
            "lot": lot,
            "constant": one.name,
        }
        value = None if one.value is None else one.number
        own |= {**one.document(), "value": value, "low_95": low, "high_95": high}
        rows.append({key: own[key] for key in CONSTANT_SCHEMA})
    return rows


def constants_frame(sheet: Datasheet) -> pl.DataFrame:
    """The constants of one datasheet, by name, with its status and version; then the parameters of
    the effects that its model lacks, as EFFECT.PARAMETER.

    Parameters
    ----------
    sheet
        The datasheet.

    """
    estimates = [estimate for _, estimate in sorted(sheet.constants.items())]
    estimates += found_estimates(sheet)
    rows = constant_rows(sheet.motor_id, sheet.motor_type, sheet.lot, estimates)
    words = {"datasheet_status": sheet.status, "datasheet_version": sheet.version}
    return pl.DataFrame(rows, schema=CONSTANT_SCHEMA, orient="row").with_columns(
        pl.lit(word, pl.String).alias(name) for name, word in words.items()
    )


def found_estimates(sheet: Datasheet) -> list[Estimate]:
    """The parameters of the effects that were found missing, as estimates named EFFECT.PARAMETER,
    by method `residual_test`.

    Parameters
    ----------
    sheet
        The datasheet.

    """
    estimates = []
    for effect, one in () if sheet.model is None else sheet.model.missing.items():
        for parameter, (value, u, unit) in one.parameters.items():
            name = f"{effect}.{parameter}"
            if value is None or u is None:
                note = one.experiment or "these captures do not determine it"
                estimates.append(not_identifiable(name, unit, "residual_test", note))
            else:
                budget = type_a(f"scatter:residual_test:{name}", u)
                words = one.headline
                estimates.append(
                    Estimate(name, value, unit, "measured", "residual_test", budget, note=words)
                )
    return estimates


def fleet_files(frames: Sequence[pl.DataFrame]) -> dict[str, bytes]:
    """`fleet.csv` and `fleet.parquet` of some motors' constants; equal tables give equal bytes.

    A list of captures is one text in CSV, its paths separated by semicolons.

    Parameters
    ----------
    frames
        Results of `constants_frame`.

    """
    whole = pl.concat(frames)
    flat, packed = io.BytesIO(), io.BytesIO()
    whole.with_columns(pl.col("captures").list.join(";")).write_csv(flat)
    whole.write_parquet(packed, compression="zstd", statistics=False)
    return {"fleet.csv": flat.getvalue(), "fleet.parquet": packed.getvalue()}
