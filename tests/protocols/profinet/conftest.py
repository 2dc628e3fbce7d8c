"""Every PROFINET model, with the limits of its manual and with others."""

from dataclasses import replace

import pytest
from gsdml_models import LIMITS, NAMES

from pnfarm.drives.catalogue import model


@pytest.fixture(params=NAMES)
def drive_model(request):
    return model(request.param)


@pytest.fixture(params=sorted(LIMITS))
def limited(request, drive_model):
    return replace(drive_model, limits=replace(drive_model.limits, **LIMITS[request.param]))
