/** The user's own objects: those that ship with the server cannot be changed and are copied first. */
import { Preference, type GraspObject, type KnownGrip } from "#contract/object_service_pb";
import type { HandPose } from "#contract/holdout_pb";
import type { App } from "./app";
import * as api from "./api";
import { toast } from "./dom";
import { freeName } from "./files";
import { meshOf } from "./object";
import { objectName } from "./words";

/** Label of objects whose file is the mesh that the server returned, in its order of triangles. */
const COPY = "grasp-viewer";

/** A copy of the shown object, which is shown from then on. */
async function copyOf(app: App, original: GraspObject): Promise<GraspObject> {
  const { glb } = await meshOf(original.name, original.etag);
  const taken = app.objects.map(({ name }) => objectName(name));
  const forbidden = original.forbiddenTriangleCount > 0;
  const shaped = original.regions.filter(({ shapes, preference }) => shapes.length > 0 && preference !== Preference.FORBIDDEN);
  const copy = await api.objects.createObject({
    object: {
      name: `objects/${freeName(`${objectName(original.name)}-own`, taken)}`,
      labels: { ...original.labels, [COPY]: "copy" },
      massKg: original.massKg,
      ...(original.centerOfMass && { centerOfMass: original.centerOfMass }),
      ...(original.friction !== undefined && { friction: original.friction }),
      regions: [
        ...(forbidden ? [{ name: "forbidden", preference: Preference.FORBIDDEN, groups: ["forbidden"] }] : []),
        ...shaped.map((region) => ({ ...region, triangles: [], groups: [] })),
      ],
      knownGrips: original.knownGrips,
    },
    mesh: glb,
  });
  await app.refreshObjects();
  toast(`Copied to ${objectName(copy.name)}`);
  app.store.edit({ object: copy.name }, "follow");
  return copy;
}

/** The shown object if it can be changed, or else a copy. `painted`: whose triangles are numbered as they are shown. */
async function changeable(app: App, painted: boolean): Promise<GraspObject> {
  const object = await api.objects.getObject({ name: app.state.object });
  const isCopy = object.labels[COPY] === "copy";
  return object.builtIn || (painted && !isCopy) ? copyOf(app, object) : object;
}

/** Keeps or bans a grip of the shown object, or, with `null`, neither. Returns the object. */
export async function setGrip(app: App, name: string, hand: HandPose, preference: Preference | null): Promise<GraspObject> {
  const object = await changeable(app, false);
  const others = object.knownGrips.filter((grip) => grip.name !== name);
  const grip = { name, preference: preference ?? Preference.PREFERRED, hand };
  const knownGrips = preference === null ? others : [...others, grip];
  const { etag } = object;
  const updated = await api.objects.updateObject({ object: { name: object.name, etag, knownGrips }, updateMask: { paths: ["known_grips"] } });
  await app.refreshObjects();
  return updated;
}

export async function removeGrip(app: App, grip: KnownGrip): Promise<void> {
  if (grip.hand) await setGrip(app, grip.name, grip.hand, null);
}

/** Saves painted triangles, by their numbers in the file, as one region per preference. */
export async function saveRegions(app: App, painted: Map<Preference, number[]>): Promise<GraspObject> {
  const object = await changeable(app, true);
  const regions = [
    ...object.regions.filter((region) => !region.name.startsWith("painted-")),
    ...[...painted]
      .filter(([, triangles]) => triangles.length > 0)
      .map(([preference, triangles]) => ({ name: `painted-${Preference[preference].toLowerCase()}`, preference, triangles })),
  ];
  const { etag } = object;
  const updated = await api.objects.updateObject({ object: { name: object.name, etag, regions }, updateMask: { paths: ["regions"] } });
  await app.refreshObjects();
  await app.showObject();
  return updated;
}
