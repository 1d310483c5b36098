"""Studies of pdvol, a folder each: `./run python -m benchmarks.NAME`. docs/benchmarks.md lists them."""
