"""The part of a motor's page that says its status: written with the page, and anew when it changes.

All else on the page is of the datasheet, which never changes, and of its fits.
"""

from __future__ import annotations

from pipeline.records.current_status import CurrentStatus
from pipeline.records.datasheet import Datasheet
from pipeline.records.model_verdict import MODEL_REASON
from pipeline.report.pages.page import render, replaced
from pipeline.views.model_words import model_words
from pipeline.views.status_text import status_lines, status_points, status_words

BEGIN, END = "<!-- status -->", "<!-- end of status -->"


def status_block(sheet: Datasheet, current: CurrentStatus) -> str:
    """Heading, status, who decided what, and the reasons that stand, between two marks.

    Parameters
    ----------
    sheet
        The datasheet.
    current
        The status in the registry.

    """
    text = render(
        "status.html.jinja",
        sheet=sheet,
        current=current,
        words=status_words(current),
        lines=status_lines(current),
        points=status_points(current.why),
        model=None if sheet.model is None else model_words(sheet.model, sheet.motor_id),
        model_reason=MODEL_REASON,
        unverified=sum(c.integrity != "verified" for c in sheet.captures),
    )
    return f"{BEGIN}\n{text.strip()}\n{END}"


def with_status(page: str, sheet: Datasheet, current: CurrentStatus) -> str:
    """The page with its status as it is now; a page without the marks stays as it is.

    No text of a capture can hold a mark: `<` is escaped in all of it.

    Parameters
    ----------
    page
        HTML text of the page.
    sheet
        The datasheet.
    current
        The status in the registry.

    """
    return replaced(page, (BEGIN, END), status_block(sheet, current))
