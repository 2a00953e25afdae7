/** Hands of rigs that were created from dropped models: drawn by the model itself, whose nodes HandPose.model poses. */
import { Group, type Object3D, Quaternion, Vector3 } from "three";
import { GLTFLoader } from "three/addons/loaders/GLTFLoader.js";

import type { HandPose } from "#contract/holdout_pb";
import { quaternion, vector } from "./poses";

interface Model {
  scene: Group;
  nodes: Map<string, Object3D>;
  rest: Map<Object3D, { position: Vector3; quaternion: Quaternion }>;
}

export class ModelHands {
  readonly group = new Group();
  private readonly models = new Map<string, Model>();

  constructor() {
    this.group.name = "models";
  }

  async add(rig: string, file: ArrayBuffer): Promise<void> {
    const { scene, parser } = await new GLTFLoader().parseAsync(file, "");
    const [nodes, rest]: [Model["nodes"], Model["rest"]] = [new Map(), new Map()];
    scene.traverse((node) => {
      // The loader changes names; the contract has those of the file.
      const index = parser.associations.get(node)?.nodes;
      const name = index === undefined ? undefined : (parser.json.nodes[index].name as string | undefined);
      if (name !== undefined && !nodes.has(name)) nodes.set(name, node);
      rest.set(node, { position: node.position.clone(), quaternion: node.quaternion.clone() });
      node.frustumCulled = false;
      node.castShadow = node.receiveShadow = true;
    });
    scene.visible = false;
    this.group.add(scene);
    this.models.set(rig, { scene, nodes, rest });
  }

  hide(): void {
    for (const { scene } of this.models.values()) scene.visible = false;
  }

  /** Poses the model of a hand; false if it has none. */
  show(hand: HandPose): boolean {
    this.hide();
    const model = this.models.get(hand.rig);
    const [root, ...posed] = hand.model;
    const rootNode = root && model?.nodes.get(root.node);
    if (!model || !rootNode) return false;
    for (const [node, { position, quaternion: turn }] of model.rest) {
      node.position.copy(position);
      node.quaternion.copy(turn);
    }
    for (const { node: name, pose } of posed) {
      const node = model.nodes.get(name);
      if (!node || !pose) continue;
      node.quaternion.copy(quaternion(pose.orientation));
      if (pose.position) node.position.copy(vector(pose.position));
    }
    // Moves the whole model so that the hand's root is where the answer has it.
    const { scene } = model;
    scene.position.set(0, 0, 0);
    scene.quaternion.identity();
    scene.scale.setScalar(1);
    scene.updateMatrixWorld(true);
    const [at, turn, size] = [new Vector3(), new Quaternion(), new Vector3()];
    rootNode.matrixWorld.decompose(at, turn, size);
    scene.scale.setScalar(hand.scale ?? 1);
    scene.quaternion.copy(quaternion(root.pose?.orientation).multiply(turn.invert()));
    scene.position.copy(vector(root.pose?.position)).sub(at.multiplyScalar(hand.scale ?? 1).applyQuaternion(scene.quaternion));
    scene.visible = true;
    return true;
  }
}
