/** Clients of a server, and its errors. */

import { Code, createClient, ConnectError, type Client, type Interceptor } from "@connectrpc/connect";
import { createConnectTransport } from "@connectrpc/connect-web";
import { BadRequestSchema, ErrorInfoSchema, RetryInfoSchema, type BadRequest_FieldViolation } from "./gen/google/rpc/error_details_pb.js";
import { GraspService } from "./gen/grasp/v1/grasp_service_pb.js";
import { HandRigService, type HandRig } from "./gen/grasp/v1/hand_rig_service_pb.js";
import { ObjectService } from "./gen/grasp/v1/object_service_pb.js";

/** The services of a server. */
export interface GraspClient {
  /** Finds grasps. */
  grasps: Client<typeof GraspService>;
  /** Manages objects. */
  objects: Client<typeof ObjectService>;
  /** Manages rigs of hands. */
  rigs: Client<typeof HandRigService>;
}

/**
 * The client of the server at a URL, such as "http://localhost:50051", with a token if the server wants one. Calls reject with a
 * `ConnectError`.
 */
export function createGraspClient(baseUrl: string, token?: string): GraspClient {
  const authorize: Interceptor = (next) => (request) => {
    if (token !== undefined) {
      request.header.set("authorization", `Bearer ${token}`);
    }
    return next(request);
  };
  const transport = createConnectTransport({ baseUrl, interceptors: [authorize] });
  return {
    grasps: createClient(GraspService, transport),
    objects: createClient(ObjectService, transport),
    rigs: createClient(HandRigService, transport),
  };
}

/**
 * The rig of your own hand or avatar: creates it from files (GLB, glTF or VRM), or takes the one that has the id. `rigId` has 1 to 63
 * characters of a-z, 0-9 and -.
 */
export async function createRigOnce({ rigs }: GraspClient, rigId: string, ...models: Uint8Array[]): Promise<HandRig> {
  try {
    return await rigs.createRig({ rigId, models });
  } catch (error) {
    if (ConnectError.from(error).code === Code.AlreadyExists) {
      return await rigs.getRig({ name: `rigs/${rigId}` });
    }
    throw error;
  }
}

/** The mesh of an object as GLB, as the server keeps it: in meters, in the object's frame. */
export async function downloadMesh({ objects }: GraspClient, name: string): Promise<Uint8Array<ArrayBuffer>> {
  const pieces: BlobPart[] = [];
  for await (const { piece } of objects.getMesh({ name })) {
    pieces.push(piece as Uint8Array<ArrayBuffer>);
  }
  return new Uint8Array(await new Blob(pieces).arrayBuffer());
}

/** The violations of an error: fields, each with its fault; empty for other errors. */
export function violations(error: unknown): BadRequest_FieldViolation[] {
  return ConnectError.from(error)
    .findDetails(BadRequestSchema)
    .flatMap(({ fieldViolations }) => fieldViolations);
}

/** The name of an error's `ErrorReason`, such as "OBJECT_NOT_FOUND"; absent if the error is not the server's. */
export function reason(error: unknown): string | undefined {
  return ConnectError.from(error).findDetails(ErrorInfoSchema)[0]?.reason;
}

/** The time after which a refused call may be made again, in milliseconds; absent if the server names none. */
export function retryDelay(error: unknown): number | undefined {
  const delay = ConnectError.from(error).findDetails(RetryInfoSchema)[0]?.retryDelay;
  return delay && Number(delay.seconds) * 1000 + delay.nanos / 1e6;
}
