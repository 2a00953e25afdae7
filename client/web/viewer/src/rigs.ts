/** The server's rigs. */
import * as api from "./api";
import { type HandRigSide, type Side, sidesOf } from "./kinematics";
import type { HandRig } from "#contract/hand_rig_service_pb";

export class Rigs {
  private readonly sides = new Map<string, HandRigSide>();
  all: HandRig[] = [];

  async load(): Promise<void> {
    let pageToken = "";
    const all: HandRig[] = [];
    do {
      const page = await api.rigs.listRigs({ pageToken });
      all.push(...page.rigs);
      pageToken = page.nextPageToken;
    } while (pageToken !== "");
    this.all = [];
    for (const rig of all) this.add(rig);
  }

  add(rig: HandRig): void {
    this.all.push(rig);
    for (const side of sidesOf(rig)) this.sides.set(`${side.rig} ${side.side}`, side);
  }

  get(rig: string, side: Side): HandRigSide | undefined {
    return this.sides.get(`${rig} ${side}`);
  }

  adult(side: Side): HandRigSide {
    return this.get("rigs/adult", side)!;
  }
}
