/** A client of Grasp for pages and Node. `@grasp/client/three` and `@grasp/client/vrm` pose hands and avatars. */

export * from "./client.js";
export * from "./conventions.js";
export * from "./hand.js";
export * from "./ik.js";
export * from "./keyFrames.js";
export * from "./packed.js";
export { compose, inverse, poseMessage, rigid, slerp, type Quat, type Rigid, type Vec3 } from "./pose.js";
export * from "./tracking.js";
export * from "./webxr.js";
export * from "./gen/grasp/v1/error_reason_pb.js";
export * from "./gen/grasp/v1/grasp_pb.js";
export * from "./gen/grasp/v1/grasp_service_pb.js";
export * from "./gen/grasp/v1/grasp_type_pb.js";
export * from "./gen/grasp/v1/hand_rig_service_pb.js";
export * from "./gen/grasp/v1/holdout_pb.js";
export * from "./gen/grasp/v1/object_service_pb.js";
export * from "./gen/grasp/v1/search_pb.js";
export * from "./gen/grasp/v1/track_pb.js";
