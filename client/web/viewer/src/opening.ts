/** What the page shows when it opens, and the calls for it. */
import type { FindGraspResponse } from "#contract/grasp_service_pb";
import type { GraspObject } from "#contract/object_service_pb";
import * as api from "./api";
import { fetchAhead } from "./object";
import { Rigs } from "./rigs";
import { findRequest, fromHash, HOLDOUTS, type State } from "./state";

/** The holdout that is shown without a link. */
const FIRST = "remote-genhold1";

export class Opening {
  readonly state: State;
  readonly rigs = new Rigs();
  readonly objects: Promise<GraspObject[]>;
  readonly rigsLoaded: Promise<void>;
  readonly found: Promise<[FindGraspResponse, number]>;

  constructor() {
    this.state = fromHash(location.hash) ?? structuredClone((HOLDOUTS.find(({ name }) => name === FIRST) ?? HOLDOUTS[0]!).state);
    this.rigsLoaded = this.rigs.load();
    this.objects = api.allObjects();
    // Only fingers that were opened or closed need the rig.
    this.found = (this.state.giver?.open ?? 0) === 0 ? this.find() : this.rigsLoaded.then(() => this.find());
    fetchAhead(this.state.object);
    // Handled where they are awaited.
    for (const call of [this.objects, this.rigsLoaded, this.found]) call.catch(() => undefined);
  }

  private find(): Promise<[FindGraspResponse, number]> {
    return api.find(findRequest(this.state, (giver) => this.rigs.get(giver.rig, giver.side)));
  }
}
