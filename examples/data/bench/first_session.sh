# What is done on the first day at a bench: look at the devices, find the joints, measure, compare, follow a path.
set -e
robot=examples/data/demo/robot.yaml bench=examples/data/bench/bench.yaml
.venv/bin/ctcr devices --bench $bench
.venv/bin/ctcr move $robot --bench $bench --at-home
.venv/bin/ctcr record $robot examples/data/bench/plan.csv --bench $bench -o build/session
.venv/bin/ctcr compare $robot build/session/measurements.csv
.venv/bin/ctcr track $robot examples/data/bench/track.yaml --live --bench $bench -o build/tracking --report build/tracking.html
