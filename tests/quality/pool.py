"""Judges many grasps in parallel processes, with a progress bar."""

import multiprocessing
import pathlib
import sys
import time
from concurrent.futures import ProcessPoolExecutor, as_completed
from dataclasses import dataclass

import matplotlib.image
import numpy as np

import choice
import draw
import holdouts
import mannequin
import measures
import parts
import physics
import stance
import taxonomy


@dataclass
class Case:
    """A reply to judge. Its scene has no mesh, because each process reads each mesh once."""

    object: str
    scene: measures.Scene
    grasp: dict
    # The receiver's other hand, if both hold the object.
    other: dict | None = None
    # Where to save a picture of hand and object alone.
    drawing: pathlib.Path | None = None


_meshes = {}


def mesh_of(name):
    """The mesh of an object, read once."""
    if name not in _meshes:
        _meshes[name] = holdouts.load_mesh(name)
    return _meshes[name]


def judged(case, simulated):
    """All measures of a case by name."""
    case.scene.mesh = mesh_of(case.object)
    grasps = [case.grasp] + ([case.other] if case.other else [])
    row = measures.judge_both(case.scene, grasps) if case.other else measures.judge(case.scene, case.grasp)
    if not case.other:
        row.update({**stance.judge(case.scene, case.grasp), **choice.judge(case.scene, case.grasp)})
        # The taxonomy is of grasps by one hand.
        row.update(taxonomy.judge(case.scene, case.grasp), **parts.judge(case.object, case.scene, case.grasp))
    if simulated and not case.scene.mesh.is_sheet():
        row.update(survival(case.scene, grasps))
    if case.drawing:
        matplotlib.image.imsave(case.drawing, draw.picture(case.scene, case.grasp))
        if not case.other:
            matplotlib.image.imsave(mannequin.file_of(case.drawing), mannequin.picture(case.scene, case.grasp))
    return row


def survival(scene, grasps):
    """How the runs in the physics engine end, of one hand or two; pushes are along the axes of the client's frame."""
    grips = [measures.in_object_frame(scene, grasp) for grasp in grasps]
    contacts = grips[0][1]
    hangs_by = np.mean([contact["position"] for contact in contacts], axis=0) if grasps[0].get("hangs") else None
    obj = physics.Object(physics.pieces(scene.mesh), scene.mass, scene.centre_of_mass, scene.friction, hangs_by)
    to_object = scene.rotation.inv()
    outcomes = physics.simulate(
        obj, *grips[0], to_object.apply(scene.up), to_object.apply(np.eye(3)), other=grips[1] if grips[1:] else None
    )
    result = {
        "survives_gravity": outcomes["gravity"].held,
        "survives_pushes": sum(o.held for name, o in outcomes.items() if name != "gravity"),
        "survives_all": all(o.held for o in outcomes.values()),
    }
    for name, outcome in outcomes.items():
        result[f"fate {name}"] = outcome.fate.value
        result[f"moved_mm {name}"] = round(1000 * outcome.distance, 2)
        result[f"turned_degrees {name}"] = round(outcome.angle, 2)
    return result


def decomposed(name):
    """Makes the convex pieces of an object and caches them. Sheets of no thickness have none and are not simulated."""
    if not mesh_of(name).is_sheet():
        physics.pieces(mesh_of(name))


def judge_all(cases, jobs, simulated):
    """The measures of all cases, in their order."""
    rows = [None] * len(cases)
    # Forked processes would inherit the threads of numba and CoACD in an unknown state.
    context = multiprocessing.get_context("spawn")
    with ProcessPoolExecutor(max_workers=min(jobs, max(1, len(cases))), mp_context=context) as pool:
        if simulated:
            # Decompose each mesh once, before several processes need it.
            waiting = [pool.submit(decomposed, name) for name in dict.fromkeys(case.object for case in cases)]
            for done in Progress("objects decomposed").over(as_completed(waiting), len(waiting)):
                done.result()
        waiting = {pool.submit(judged, case, simulated): i for i, case in enumerate(cases)}
        for done in Progress("grasps judged").over(as_completed(waiting), len(cases)):
            rows[waiting[done]] = done.result()
    return rows


class Progress:
    """A progress bar with a count and the elapsed time: one line in a terminal, elsewhere a line per tenth."""

    WIDTH = 30

    def __init__(self, what):
        self.what, self.began, self.shown = what, time.monotonic(), 0

    def over(self, items, total=None):
        """Yields the items and shows how many are done."""
        total = total or len(items)
        for done, item in enumerate(items, 1):
            yield item
            self._show(done, total)

    def _show(self, done, total):
        terminal = sys.stdout.isatty()
        if not terminal and done * 10 // total == self.shown:
            return
        self.shown = done * 10 // total
        bar = ("#" * (self.WIDTH * done // total)).ljust(self.WIDTH, ".")
        line = f"[{bar}] {done} of {total} {self.what} ({time.monotonic() - self.began:.0f} s)"
        last = not terminal or done == total
        print(f"\r{line}" if terminal else line, end="\n" if last else "", flush=True)
