"""Files as people have them, from bug reports of other programs: each script makes some and looks at them.

The scripts print SAME where samples are as written, REFUSED and a sentence, warnings, and TRACEBACK. Where
samples have to differ from those that were written, as by a scale of the header, they print DIFFERENT.
"""

import os
import re
import shutil
import subprocess
import sys
from collections import Counter
from importlib.util import find_spec

import pytest

from tests.real_data import FOLDER

CASES = FOLDER.parent / "cases"
MASKED = "got 576 that are NaN or infinite"  # land, in each file of NetCDF
LFS = "got a pointer of Git LFS in its place; run git lfs pull"
# Files that are read as they were written, and otherwise; and what has to be said, how often.
EXPECTED = {
    "01-ome-two-images": (4, 0, {"image: expected one of 0 (": 2, "step 0 of 3": 2, "the only volume": 1}),
    "02-h5-vds": (
        1,
        1,
        {"expected its part data of part1.h5, which is not": 1, "7 of 12 chunks are not there": 1},
    ),
    "03-h5-links": (4, 0, {"entry/data links to gone.h5, which is not there": 1, "choose one of": 4}),
    "04-mrc-map": (8, 2, {"READ: Volume zyx: 12 x 14 x 16": 1, "tells no spacing": 1, "got complex64": 1}),
    "05-tiff-lzw-predictor": (10, 0, {"pip install '.[tiff]'": 3, "got 3 components": 2, "got complex64": 1}),
    "08-nc-default-fill": (0, 1, {MASKED: 7, "float32, -1 to 843": 2, "got number 3 x time 2 x lev 12": 1}),
    "09-zarr-missing-chunk": (
        7,
        1,
        {"1 of 3 chunks are not there and count as 0": 2, "choose one of 0, 1": 1},
    ),
    "12-lfs-annex": (0, 0, {LFS: 15, "which is not there; get it, as by git annex get": 2}),
    "14-log-density": (4, 0, {"left out: 1": 2, "whole numbers above 16777216 are rounded": 1}),
    "15-nc-axis-order": (7, 0, {"so that samples are 1 apart": 4, "expected even distances along lon": 1}),
    "18-ct-padding": (1, 1, {"27.8 % of the samples are padding (-2000)": 1, "int16, -1067 to 821": 2}),
    "22-dicom-compressed": (
        14,
        0,
        {
            "so that ImagerPixelSpacing is taken": 1,
            "unpack it": 1,
            "open the folder with all of the series": 1,
        },
    ),
    "23-dicom-enhanced": (1, 3, {"int16, -524 to 319": 2, "float32, -5 to 3.43": 1, "(0.5, 0.5, 1.5)": 4}),
    "30-tiff-folders": (2, 0, {"channel: expected one of 0 (0), 1 (1)": 3, "s000.tif and s000_mask.tif": 1}),
    "33-ome-files": (3, 0, {"4 of 12 slices are missing; put stack_1.ome.tif": 1}),
    "36-saturated": (0, 0, {"'TF01': [(49.0, 0.0), (66.8, 0.3), (120.0, 0.3)]": 3, "[(140.4, 0.0)": 1}),
}


@pytest.mark.subprocess
@pytest.mark.parametrize("case", EXPECTED)
def test_files_of_people(case, tmp_path):
    if not (CASES / case).is_dir():
        pytest.skip(f"{case} is not in {CASES}; set TEXGS_TEST_DATA to a folder beside it")
    if case.startswith("05") and find_spec("imagecodecs"):
        pytest.skip("with imagecodecs, what is refused here is read")
    shutil.copytree(CASES / case, tmp_path / case)
    (tmp_path / case).chmod(0o755)  # they may be read-only
    for helper in ("common.py", "dcm.py"):
        shutil.copy(CASES / helper, tmp_path)
    command = [sys.executable, "make.py"]
    done = subprocess.run(
        command, cwd=tmp_path / case, stdout=-1, stderr=-2, text=True, env={**os.environ, "COLUMNS": "1000"}
    )
    kinds = Counter(re.findall(r"^(SAME|DIFFERENT|TRACEBACK)", done.stdout, flags=re.MULTILINE))
    same, different, sentences = EXPECTED[case]
    assert done.returncode == 0, done.stdout
    assert "Traceback" not in done.stdout
    assert kinds == Counter({"SAME": same, "DIFFERENT": different}) + Counter()
    assert {words: done.stdout.count(words) for words in sentences} == sentences, done.stdout
