#!/usr/bin/env python3
"""Prints the main metrics of a run.

  print_headline.py REPORT.json
"""

import json
import pathlib
import sys


def shown(holder, key, unit="dB", decimals=2):
    """The metric, or the reason why it is missing."""
    value = (holder or {}).get(key)
    if value is None:
        return f"– ({(holder or {}).get(key + '_why', 'not measured')})"
    return f"{value:.{decimals}f} {unit}".rstrip()


def main():
    if len(sys.argv) != 2 or sys.argv[1] == "--help":
        print(__doc__)
        return 0 if "--help" in sys.argv else 2
    report = json.loads(pathlib.Path(sys.argv[1]).read_text(encoding="utf-8"))
    consistency = {(row["sequence"], row["gap"]): row for row in report["consistency"]}
    fidelity = {row["sequence"]: row for row in report["fidelity"]}
    reconstruct = report["stages"].get("reconstruct") or {}
    word = reconstruct.get("sharpness", "")
    gap = min((gap for _, gap in consistency), default=1)
    print(f"held-out PSNR of the reconstruction   {shown(reconstruct, 'psnr_heldout_db')}")
    print(f"    its SSIM                          {shown(reconstruct, 'ssim_heldout', '', 3)}")
    print(f"    its detail kept, of 1             {shown(reconstruct, 'detail_kept_heldout', '')}{word and ', ' + word}")
    print(f"consistency, frame by frame in 2D     {shown(consistency.get(('views_2d', gap)), 'tc_psnr_mean_db')}")
    print(f"consistency, the styled scene         {shown(consistency.get(('styled', gap)), 'tc_psnr_mean_db')}")
    print(f"fidelity of the styled scene to 2D    {shown(fidelity.get('styled'), 'psnr_to_2d_db')}")
    print(f"time                                  {report['seconds']:.0f} s")
    return 0


if __name__ == "__main__":
    sys.exit(main())
