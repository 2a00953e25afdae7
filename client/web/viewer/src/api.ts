/** Calls of the server that serves the page. */
import { create, fromJson, type MessageInitShape, type JsonValue } from "@bufbuild/protobuf";
import { type Client, Code, ConnectError, createClient, type Interceptor } from "@connectrpc/connect";
import { createGrpcWebTransport } from "@connectrpc/connect-web";

import {
  type FindGraspRequestSchema,
  type FindGraspResponse,
  GraspService,
  type StreamGraspsRequestSchema,
} from "#contract/grasp_service_pb";
import { HandRigService } from "#contract/hand_rig_service_pb";
import { type GraspObject, ObjectService, ObjectView } from "#contract/object_service_pb";
import { TrackSchema, type Track } from "#contract/track_pb";

/** Where this tab keeps its token. */
const TOKEN = "grasp-token";

/** Sends the tab's token, and asks for one when the server wants another. */
const authorize: Interceptor = (next) => async (request) => {
  const token = sessionStorage.getItem(TOKEN);
  const send = (secret: string | null) => {
    if (secret) request.header.set("authorization", `Bearer ${secret}`);
    return next(request);
  };
  try {
    return await send(token);
  } catch (error) {
    if (ConnectError.from(error).code !== Code.Unauthenticated) throw error;
    // Another call may have asked meanwhile.
    let newer = sessionStorage.getItem(TOKEN);
    if (newer === token) {
      newer = prompt("This server wants a token:")?.trim() ?? null;
      if (!newer) throw error;
      sessionStorage.setItem(TOKEN, newer);
    }
    return send(newer);
  }
};

const transport = createGrpcWebTransport({ baseUrl: location.origin, interceptors: [authorize] });

export const grasps: Client<typeof GraspService> = createClient(GraspService, transport);
export const objects: Client<typeof ObjectService> = createClient(ObjectService, transport);
export const rigs: Client<typeof HandRigService> = createClient(HandRigService, transport);

/** A call's answer, and the milliseconds from the call to it. */
export async function timed<T>(call: Promise<T>): Promise<[T, number]> {
  const start = performance.now();
  const answer = await call;
  return [answer, performance.now() - start];
}

export function find(request: MessageInitShape<typeof FindGraspRequestSchema>): Promise<[FindGraspResponse, number]> {
  return timed(grasps.findGrasp(request));
}

/** The grasps of a stream. */
export async function stream(request: MessageInitShape<typeof StreamGraspsRequestSchema>): Promise<FindGraspResponse[]> {
  const answers: FindGraspResponse[] = [];
  for await (const answer of grasps.streamGrasps(request)) answers.push(answer);
  return answers;
}

/** An object's mesh as a GLB. */
export async function mesh(name: string): Promise<Uint8Array<ArrayBuffer>> {
  const pieces: Uint8Array<ArrayBuffer>[] = [];
  for await (const { piece } of objects.getMesh({ name })) pieces.push(new Uint8Array(piece));
  return new Uint8Array(await new Blob(pieces).arrayBuffer());
}

/** All objects, by name. */
export async function allObjects(): Promise<GraspObject[]> {
  const all: GraspObject[] = [];
  let pageToken = "";
  do {
    const page = await objects.listObjects({ pageToken, pageSize: 100, view: ObjectView.FULL });
    all.push(...page.objects);
    pageToken = page.nextPageToken;
  } while (pageToken !== "");
  return all;
}

/** A track of a file with a motion, in protobuf's JSON. */
export function trackOf(json: JsonValue): Track {
  return json === null ? create(TrackSchema) : fromJson(TrackSchema, json);
}

/** An error in words, with the violations that the server found. */
export function inWords(error: unknown): string {
  if (!(error instanceof ConnectError)) return error instanceof Error ? error.message : String(error);
  if (error.code === Code.Unavailable || error.rawMessage.includes("fetch")) return "The server does not answer.";
  return error.rawMessage;
}

export function isGone(error: unknown): boolean {
  return error instanceof ConnectError && (error.code === Code.NotFound || error.code === Code.DeadlineExceeded);
}
