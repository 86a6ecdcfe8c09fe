"""Stage render_reports: tables, figures, pages and replays from what the other stages wrote."""

import logging
import shutil
from pathlib import Path
from typing import Any

import numpy as np
import pandas as pd

from guided_lgp.experiments.files import write_metrics
from guided_lgp.params import Params
from guided_lgp.paths import METRICS, REPORTS
from guided_lgp.report import analysis, figures, tables
from guided_lgp.report.contents import compose
from guided_lgp.report.inputs import Inputs, load_inputs
from guided_lgp.report.pictures import draw_scene
from guided_lgp.report.style import NETWORKS
from guided_lgp.report.table import Table
from guided_lgp.scene import Scene

logger = logging.getLogger(__name__)
