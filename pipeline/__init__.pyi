from pipeline.api.datasheets import check as check
from pipeline.api.datasheets import load as load
from pipeline.api.fits import fit as fit
from pipeline.api.models import compare as compare
from pipeline.api.models import diagnose as diagnose
from pipeline.api.recordings import read as read
from pipeline.api.simulated import simulate as simulate

__all__ = ["check", "compare", "diagnose", "fit", "load", "read", "simulate"]
__version__: str
