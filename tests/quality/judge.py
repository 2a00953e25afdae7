#!/usr/bin/env python3
"""Requests grasps from a real server and judges each reply with code that shares nothing with the search.

The exit code is 0 if there were grasps to judge, good or bad. With --least-sound it is 1 if too many of them have
faults, with --strict if a target is not met.
"""

import argparse
import collections
import dataclasses
import json
import os
import pathlib
import time

import numpy as np
from scipy.spatial.transform import Rotation

import relations
import holdouts
import measures
import pool
import report
import stance
from service import Service, built_in_request

# Budget of a request, and of a second one that finds out whether there is any grasp at all.
BUDGET_SECONDS, EXHAUSTIVE_SECONDS = 0.05, 5.0
# Default friction of each validity: leather on metal, and skin on plastic.
THESIS_FRICTION, PHYSICAL_FRICTION = 0.34, 0.6


def arguments():
    parser = argparse.ArgumentParser(prog="tests/quality/run", description=__doc__)
    parser.add_argument("--sample", type=int, default=10, help="random holdouts per object (default: 10)")
    parser.add_argument("--seeds", type=int, default=1, help="searches per built-in holdout (default: 1)")
    parser.add_argument(
        "--objects",
        default="all",
        help="all (built-in and real), built-in, real, everyday, or comma-separated names, such as remote,osim_mug,pan",
    )
    parser.add_argument("--validity", help="validity of the requests, such as thesis (default: the server's)")
    parser.add_argument("--strategy", help="strategy of the requests, such as F (default: the server's)")
    parser.add_argument("--choice", help="choice of the requests, such as best (default: the server's)")
    parser.add_argument("--no-atlas", action="store_true", help="request searches without atlases")
    parser.add_argument("--rig", help="rig of the receiving hand (default: the server's)")
    parser.add_argument(
        "--hand",
        choices=["left", "right", "unspecified"],
        default="right",
        help="receiving hand (default: right); unspecified leaves it to the server",
    )
    parser.add_argument(
        "--givers",
        choices=["all", "none"],
        default="all",
        help="none: nobody holds the objects, which stand, turned about the vertical (default: all)",
    )
    parser.add_argument(
        "--search-stance",
        action="store_true",
        help="where the hand fits no plausible receiver, find out whether another valid one does (5 s each)",
    )
    parser.add_argument("--seed", type=int, default=1, help="seed of the random holdouts and searches (default: 1)")
    parser.add_argument("--workers", type=int, help="search threads of the server (default: the server's)")
    parser.add_argument(
        "--jobs", type=int, default=os.cpu_count(), help="processes that judge (default: one per core)"
    )
    parser.add_argument("--no-simulation", action="store_true", help="skip the physics engine")
    parser.add_argument("--pictures", type=int, default=24, help="pictures on the contact sheet (default: 24)")
    parser.add_argument("--out", type=pathlib.Path, default=holdouts.ROOT / "target/quality/report")
    parser.add_argument(
        "--least-sound",
        type=float,
        default=0,
        metavar="PERCENT",
        help="exit with 1 if fewer of the grasps are without fault (default: 0)",
    )
    parser.add_argument(
        "--compare", type=pathlib.Path, metavar="REPORT", help="folder of an earlier report to compare the figures with"
    )
    parser.add_argument("--strict", action="store_true", help="exit with 1 if a target is not met")
    return parser.parse_args()


def chosen_objects(wanted):
    """The names of the chosen objects, and all everyday objects by name if one of those is chosen.

    Prints why real ones are skipped if there is no data.
    """
    real = sorted(holdouts.REAL) if holdouts.data_folder() else []
    known = {"built-in": holdouts.BUILT_IN, "real": real, "all": holdouts.BUILT_IN + real}
    names = known.get(wanted) or wanted.split(",")
    if wanted not in ("built-in", "everyday") and not real:
        print("SKIPPED real objects and recorded givers: no data (set GRASP_TEST_DATA to their folder)")
    if set(names) <= set(known["all"]):
        return names, {}
    things = holdouts.things()
    if wanted == "everyday":
        names = list(things)
    for name in names:
        if name not in known["all"] and name not in things:
            choices = ", ".join([*known["all"], *things])
            raise SystemExit(f"unknown object {name!r}; must be one of {choices}")
    return names, things


def cases(name, service, options, givers, thing):
    """Yields the requests on one object, each with a label and the scene that judging needs.

    `givers` are hands to place on the object; or, on an everyday one, `thing`, those that hold it. Without any, nobody
    holds the object.
    """
    mesh = holdouts.load_mesh(name)
    if name in holdouts.BUILT_IN:
        description = service.object(name)
    elif thing:
        description = holdouts.create(service, thing)
    else:
        description = service.create(name.replace("_", "-").lower(), holdouts.mesh_file(name), holdouts.REAL[name])
    requests = []
    if name in holdouts.BUILT_IN and givers:
        for holdout in holdouts.built_in_holdouts(name):
            for turn in range(options.seeds):
                requests.append((f"{holdout}", built_in_request(holdout), options.seed + turn))
    if thing:
        requests += holdouts.requests(thing, givers, options.seed)
    # One random stream per holdout, so that adding an object or a holdout changes no other.
    placer = holdouts.Placer(mesh) if givers and not thing else None
    for i in range(0 if thing else options.sample):
        random = np.random.default_rng([options.seed, i, *name.encode()])
        if placer:
            request = holdouts.random_request(description["name"], placer, givers, random)
        else:
            request = holdouts.standing_request(description["name"], random)
        requests.append((f"random {i}", request, int(random.integers(2**31))))
    for label, request, seed in requests:
        request["seed"] = str(seed)
        request["validity"] = options.validity
        request["strategy"] = options.strategy
        # Requests for both hands name no handedness.
        if request.get("hands") != "both":
            hand = {**(request.get("receiving_hand") or {}), "handedness": asked_handedness(options)}
            request["receiving_hand"] = {**hand, "rig": options.rig} if options.rig else hand
        pose = request["client_from_object"]
        yield label, request, measures.Scene(
            mesh=mesh,
            mass=description["mass_kg"],
            centre_of_mass=np.array(description["centre_of_mass"]),
            friction=description.get("friction"),
            reach=float(np.linalg.norm(description["box_half_extents"])),
            forbidden=holdouts.forbidden_triangles(name, mesh, thing),
            rotation=Rotation.from_quat(pose["orientation"]),
            translation=np.array(pose["position"]),
            up=np.array(request.get("up") or [0.0, 1.0, 0.0]),
            giver=holdouts.giver_of_request(request),
            asked_handedness=asked_handedness(options),
        )


def asked_handedness(options):
    """The handedness of the requests, or None if it is left to the server."""
    return None if options.hand == "unspecified" else options.hand


def friction_in_force(request, described, validity):
    """The coefficient that the answer assumes: the request's, the object's, or the default of the validity."""
    return request.get("friction") or described or (PHYSICAL_FRICTION if validity == "physical" else THESIS_FRICTION)


def ask(service, request, options, **picture):
    """The answer within the usual budget, or else within a long one, and whether it came within the usual one."""
    # A search for the best grasp uses its whole budget, so leave that to the server's short default.
    usual = None if options.choice == "best" else BUDGET_SECONDS
    how = {"choice": options.choice, "no_atlas": options.no_atlas, **picture}
    answer = service.find({**request, "budget_seconds": usual}, **how)
    in_time = answer["outcome"] == "found"
    if not in_time:
        answer = service.find({**request, "budget_seconds": EXHAUSTIVE_SECONDS}, **how)
    return answer, in_time


def everyday_givers(names, things, options):
    """Givers of the everyday objects by name, from a server of their own: the judged server must not know them."""
    chosen = [things[name] for name in names if name in things and not things[name].beyond]
    if not chosen or options.givers == "none":
        return {}
    with Service(options.workers, "--builder-threads", "0") as service:
        return holdouts.make_givers(service, chosen, options.seed, asked_handedness(options))


def collect(names, things, options):
    """Requests all grasps. Returns a row per holdout, and the replies to judge by the index of their row."""
    recorded = holdouts.recorded_hands() if options.givers == "all" else []
    everyday_hands = everyday_givers(names, things, options)
    pictures = options.out / "pictures"
    pictures.mkdir(parents=True, exist_ok=True)
    for old in pictures.glob("*.png"):
        old.unlink()
    rows, replies, drawn = [], {}, collections.Counter()
    share = -(-options.pictures // len(names))
    with Service(options.workers) as service, open(options.out / "replies.jsonl", "w") as file:
        if not options.no_atlas:
            service.wait_for_atlases(name for name in names if name in holdouts.BUILT_IN)
        for name in pool.Progress("objects requested").over(names):
            thing = things.get(name)
            givers = everyday_hands.get(name, []) if thing else recorded
            for label, request, scene in cases(name, service, options, givers, thing):
                picture = pictures / f"{name}-{drawn[name]:02}.png"
                wanted = {"picture": picture} if drawn[name] < share else {}
                answer, in_time = ask(service, request, options, **wanted)
                row = {"object": name, "holdout": label, "seed": request["seed"], "found": answer["grasp"] is not None}
                row["everyday"], row["both"] = thing is not None, request.get("hands") == "both"
                # An atlas is not yet grown when an object is requested as soon as it is created.
                row["cold"] = options.no_atlas or (thing is not None and label == "alone")
                row["search_ms"] = 1000 * answer["report"]["search_time_seconds"]
                row["round_trip_ms"] = 1000 * answer["round_trip_seconds"]
                row["in_time"] = in_time and row["search_ms"] <= 1000 * BUDGET_SECONDS
                row["round_trip_in_time"] = in_time and row["round_trip_ms"] <= 1000 * BUDGET_SECONDS
                row["validity"] = options.validity or "physical"
                scene.friction = friction_in_force(request, scene.friction, row["validity"])
                if answer["grasp"]:
                    if options.search_stance and not stance.fits(scene, answer["grasp"]):
                        handedness = answer["grasp"]["handedness"]
                        row["stance_possible"] = stance.has_fitting(service, request, scene, handedness)
                    drawing = picture.with_name(f"{picture.stem}-alone.png") if wanted else None
                    replies[len(rows)] = pool.Case(
                        name, dataclasses.replace(scene, mesh=None), answer["grasp"], answer.get("other_grasp"), drawing
                    )
                    file.write(json.dumps({"request": request, "answer": answer}) + "\n")
                    if wanted:
                        row["picture"] = picture.name
                        drawn[name] += 1
                rows.append(row)
    return rows, replies


def main():
    options = arguments()
    began = time.monotonic()
    names, things = chosen_objects(options.objects)
    rows, replies = collect(names, things, options)
    # Judging takes all cores, so it starts after the server has ended: it would delay searches.
    judged = pool.judge_all(list(replies.values()), options.jobs, not options.no_simulation)
    for row, found in zip(replies, judged):
        rows[row].update(found)
    targets = report.targets(rows)
    print()
    print(report.table(targets))
    comparison = relations.table(targets, options.compare) if options.compare else ""
    if comparison:
        print(f"\n{comparison}")
    report.write(options.out, rows, targets, vars(options), holdouts.table(rows, things), comparison)
    print(f"\n{len(rows)} holdouts in {time.monotonic() - began:.0f} s; the report is {options.out}/README.md")
    if not any(row["found"] for row in rows):
        raise SystemExit("no grasp was found, so there is nothing to judge")
    sound = 100 * report.sound_share(rows)
    if sound < options.least_sound:
        raise SystemExit(f"{sound:.0f} % of the grasps are without fault; must be at least {options.least_sound:.0f} %")
    if options.strict and not all(target.met for target in targets if target.met is not None):
        raise SystemExit(1)


if __name__ == "__main__":
    main()
