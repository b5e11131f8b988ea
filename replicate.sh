#!/bin/sh
# A table and a figure of the paper for its data set `engine`, from public data: docs/workflow.md.
cd "$(dirname "$0")" && make install && .venv/bin/texgs run dataset=engine fit=quick && ls -l results/tables/fitting.md results/engine/scene/quick/pse/pse.png results/report.html
