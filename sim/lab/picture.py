"""Picture of a cell's run."""

from pathlib import Path

import numpy as np

from wallride.sim.figures.drawing import save_plot
from wallride.sim.lab.cell import Cell, Figures, course_name, module_of


def save(folder: Path, cell: Cell, figures: Figures) -> None:
    """Drive the cell once more, which gives the same run, and draw it."""
    done = module_of(cell.experiment).run(cell)
    course = course_name(cell.scenario)
    end = "contact" if figures["collided"] else "stands" if figures["stopped_for_good"] else "done"
    title = f"{cell.law}: {course}, {cell.side}, {cell.speed_mps:g} m/s, mu {cell.mu:g}, seed {cell.seed}: {end}"
    name = f"{cell.experiment}-{course}-{cell.law}-{cell.speed_mps:g}-{cell.mu:g}-{cell.side}-{cell.seed}.png"
    error_m = np.where(np.isfinite(done.error_m), done.error_m, np.nan)
    save_plot(folder / name.replace(" ", "_"), done.case.world, done.pose, done.time_s, error_m, title)
