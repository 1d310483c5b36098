"""What ParaView makes of an export's open_in_paraview.py: a program for pvpython, apart from pdvol's environment.

pvpython in_paraview.py SCRIPT PICTURE.png   prints one JSON object
"""

import json
import runpy
import sys

script, picture = sys.argv[1:3]
sys.argv = [script, picture]
runpy.run_path(script)

from paraview import servermanager, simple  # noqa: E402
from vtkmodules.util.numpy_support import vtk_to_numpy  # noqa: E402

version = simple.GetParaViewVersion()
found = {
    "version": f"{version.major}.{version.minor}",
    "times": list(simple.GetTimeKeeper().TimestepValues),
    "legend": list(simple.GetColorTransferFunction("body").Annotations),
    "levels": {},
}
for (name, _), warped in sorted(simple.GetSources().items()):
    if name.endswith("in motion"):
        states = []
        for time in found["times"]:
            warped.UpdatePipeline(time)
            grid = servermanager.Fetch(warped)
            states.append(vtk_to_numpy(grid.GetPoints().GetData()).tolist())
        found["levels"][name.split()[1]] = {
            "states": states,
            "bodies": vtk_to_numpy(grid.GetCellData().GetArray("body")).tolist(),
            "points": sorted(warped.PointData.keys()),
        }
print("\nFOUND", json.dumps(found))
