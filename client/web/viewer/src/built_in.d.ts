/** The built-in holdouts as the files in assets/holdouts have them, in the thesis's frames. */
declare module "#holdouts" {
  interface FilePose {
    position: [number, number, number];
    orientation: [number, number, number, number];
  }
  interface FileAngles {
    base_yaw: number;
    base_pitch: number;
    second_pitch: number;
    third_pitch: number;
  }
  const holdouts: {
    name: string;
    object: string;
    world_from_object: FilePose;
    giver_rig: string;
    giver_handedness: "left" | "right";
    world_from_giver_wrist: FilePose;
    giver_digits: FileAngles[];
  }[];
  export default holdouts;
}

declare module "#hands/*" {
  const glb: Uint8Array<ArrayBuffer>;
  export default glb;
}
