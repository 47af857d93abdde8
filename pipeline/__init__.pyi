from pipeline.api.datasheets import Datasheets as Datasheets
from pipeline.api.datasheets import check as check
from pipeline.api.datasheets import load as load
from pipeline.api.figure import Figure as Figure
from pipeline.api.fits import Fits as Fits
from pipeline.api.fits import fit as fit
from pipeline.api.models import Comparisons as Comparisons
from pipeline.api.models import Diagnoses as Diagnoses
from pipeline.api.models import compare as compare
from pipeline.api.models import diagnose as diagnose
from pipeline.api.performance import operate as operate
from pipeline.api.recordings import Recordings as Recordings
from pipeline.api.recordings import read as read
from pipeline.api.simulated import simulate as simulate

__all__ = [
    "Comparisons",
    "Datasheets",
    "Diagnoses",
    "Figure",
    "Fits",
    "Recordings",
    "check",
    "compare",
    "diagnose",
    "fit",
    "load",
    "operate",
    "read",
    "simulate",
]
__version__: str
