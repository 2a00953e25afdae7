/** The stage: renderer, light, sky, ground and camera. Draws only when something has changed. */
import {
  BackSide,
  CanvasTexture,
  CircleGeometry,
  Color,
  DataUtils,
  DirectionalLight,
  Group,
  HalfFloatType,
  HemisphereLight,
  Mesh,
  MeshStandardMaterial,
  NeutralToneMapping,
  type Object3D,
  PCFShadowMap,
  PerspectiveCamera,
  Scene,
  ShaderMaterial,
  SphereGeometry,
  SRGBColorSpace,
  Vector3,
  WebGLRenderer,
  WebGLRenderTarget,
} from "three";
import { OrbitControls } from "three/addons/controls/OrbitControls.js";

/** Height of a held-out object above the ground, in meters. */
export const HELD_HEIGHT = 1.12;

/** Pixels that the panels cover, and the width up to which they lie below. */
const PANELS = { left: 90, right: 320, top: 54 };
const NARROW = 760;

/** Pixels per point, while a slow picture moves, and else. */
const COARSE = 0.5;
const FINE = Math.min(devicePixelRatio, 2);

/** A picture is slow that takes longer, and the page still after, in milliseconds. */
const SLOW = 120;
const STILL = 250;

/** True where the processor draws, for which antialiasing takes a quarter of the time. */
function isSoftware(): boolean {
  const gl = document.createElement("canvas").getContext("webgl2");
  const name = gl?.getExtension("WEBGL_debug_renderer_info")?.UNMASKED_RENDERER_WEBGL;
  const renderer = String(name === undefined ? "" : gl?.getParameter(name));
  gl?.getExtension("WEBGL_lose_context")?.loseContext();
  return /swiftshader|llvmpipe|software/i.test(renderer);
}

const SKY = { top: new Color("#0d131c"), horizon: new Color("#3a4a5e") };

export class Stage {
  readonly renderer: WebGLRenderer;
  readonly scene = new Scene();
  readonly camera = new PerspectiveCamera(35, 1, 0.02, 60);
  /** Moves the camera of a headset. */
  readonly rig = new Group();
  readonly controls: OrbitControls;
  /** Everything but sky and ground. */
  readonly content = new Group();
  readonly ground = new Group();
  private readonly key = new DirectionalLight("#fff1e0", 3.1);
  private wanted = false;
  private shadowsWanted = true;
  /** Called before each picture. */
  readonly beforeDraw: (() => void)[] = [];
  /** Milliseconds of the last pictures. */
  readonly frameTimes: number[] = [];

  constructor(readonly canvas: HTMLCanvasElement) {
    const software = isSoftware();
    this.renderer = new WebGLRenderer({ canvas, antialias: !software, powerPreference: "high-performance" });
    this.renderer.setPixelRatio(software ? COARSE : FINE);
    this.renderer.toneMapping = NeutralToneMapping;
    this.renderer.toneMappingExposure = 0.92;
    this.renderer.outputColorSpace = SRGBColorSpace;
    this.renderer.shadowMap.enabled = true;
    this.renderer.shadowMap.type = PCFShadowMap;
    this.renderer.shadowMap.autoUpdate = false;
    this.rig.add(this.camera);
    this.scene.add(this.content, this.ground, this.rig);
    this.addLight();
    this.addSky();
    this.addGround();
    this.ground.position.y = -HELD_HEIGHT;
    this.camera.position.set(0.62, 0.3, 0.34);
    this.controls = new OrbitControls(this.camera, canvas);
    this.controls.enableDamping = false;
    this.controls.minDistance = 0.08;
    this.controls.maxDistance = 8;
    this.controls.addEventListener("change", () => this.draw(false));
    new ResizeObserver(() => this.resize()).observe(canvas.parentElement!);
    this.resize();
  }

  /** Draws nothing until everything is there: the first picture takes long where there is no graphics card. */
  start(): void {
    this.hasStarted = true;
    this.draw();
  }

  /** Draws with the next frame of the screen; shadows are drawn anew if something has moved. */
  draw(hasMoved = true): void {
    this.shadowsWanted ||= hasMoved;
    if (!this.hasStarted) return;
    if (this.wanted && this.isLooping) return;
    this.wanted = true;
    if (!this.isLooping) this.loop();
  }

  private isLooping = false;
  private refining = 0;
  private hasStarted = false;
  private readonly afterwards: (() => void)[] = [];

  /** Calls once after the next picture. */
  afterNextPicture(then: () => void): void {
    this.afterwards.push(then);
    this.draw(false);
  }

  private loop(): void {
    this.isLooping = true;
    clearTimeout(this.refining);
    let last = 0;
    this.renderer.setAnimationLoop((now) => {
      if (!this.wanted && !this.renderer.xr.isPresenting) {
        this.renderer.setAnimationLoop(null);
        this.isLooping = false;
        this.refining = window.setTimeout(() => this.sharpen(FINE), STILL);
        return;
      }
      if (last > 0 && now - last > SLOW && !this.renderer.xr.isPresenting) this.sharpen(COARSE);
      last = now;
      this.wanted = false;
      this.picture();
    });
  }

  /** Where there is no fast graphics card, pictures are coarse while something moves, and fine once all is still. */
  private sharpen(pixelRatio: number): void {
    if (this.isLooping === (pixelRatio === FINE) || this.renderer.getPixelRatio() === pixelRatio) return;
    this.renderer.setPixelRatio(pixelRatio);
    if (!this.isLooping) this.picture();
  }

  private picture(): void {
    const start = performance.now();
    for (const prepare of this.beforeDraw) prepare();
    this.renderer.shadowMap.needsUpdate = this.shadowsWanted;
    this.shadowsWanted = false;
    this.renderer.render(this.scene, this.camera);
    this.frameTimes.push(performance.now() - start);
    if (this.frameTimes.length > 120) this.frameTimes.shift();
    for (const then of this.afterwards.splice(0)) then();
  }

  /** A small picture of a ball from a direction, with only `shown` of the content. */
  snapshot(width: number, height: number, center: Vector3, radius: number, from: Vector3, shown: Object3D[]): HTMLCanvasElement {
    const camera = new PerspectiveCamera(28, width / height, 0.02, 60);
    camera.position.copy(center).addScaledVector(from.clone().normalize(), (1.05 * radius) / Math.sin((14 * Math.PI) / 180));
    camera.lookAt(center);
    const all: Object3D[] = [];
    this.content.traverse((node) => all.push(node));
    const kept = new Set<Object3D>();
    for (const node of shown) {
      node.traverse((below) => void kept.add(below));
      node.traverseAncestors((above) => void kept.add(above));
    }
    const hidden = all.filter((node) => node.visible && !kept.has(node));
    const extras = this.scene.children.filter((node) => node.visible && node !== this.content && !("isLight" in node) && node.name !== "sky");
    for (const node of [...hidden, ...extras]) node.visible = false;
    this.renderer.shadowMap.needsUpdate = false;
    const target = new WebGLRenderTarget(width, height, { type: HalfFloatType, samples: 4 });
    this.renderer.setRenderTarget(target);
    this.renderer.render(this.scene, camera);
    this.renderer.setRenderTarget(null);
    for (const node of [...hidden, ...extras]) node.visible = true;
    const linear = new Uint16Array(4 * width * height);
    this.renderer.readRenderTargetPixels(target, 0, 0, width, height, linear);
    target.dispose();
    const picture = document.createElement("canvas");
    [picture.width, picture.height] = [width, height];
    const context = picture.getContext("2d")!;
    const image = context.createImageData(width, height);
    for (let y = 0; y < height; y++) {
      for (let x = 0; x < 4 * width; x++) {
        // Bottom row first, and light as it is.
        const light = DataUtils.fromHalfFloat(linear[4 * width * (height - 1 - y) + x]!) * this.renderer.toneMappingExposure;
        image.data[4 * width * y + x] = x % 4 === 3 ? 255 : 255 * Math.min(light, 1) ** (1 / 2.2);
      }
    }
    context.putImageData(image, 0, 0);
    return picture;
  }

  /** Looks at a ball from a direction, or from the present one. */
  frame(center: Vector3, radius: number, from?: Vector3): void {
    const direction = from?.clone() ?? this.camera.position.clone().sub(this.controls.target);
    const half = (this.camera.fov * Math.PI) / 360;
    const { clientWidth, clientHeight } = this.canvas;
    const free = clientWidth > NARROW ? clientWidth - PANELS.left - PANELS.right : clientWidth;
    const fit = Math.tan(half) * Math.min(1 - PANELS.top / clientHeight, free / clientHeight);
    this.controls.target.copy(center);
    this.camera.position.copy(center).addScaledVector(direction.normalize(), radius / fit + radius * 0.2);
    this.controls.update();
    this.draw(false);
  }

  /** As large as its place on the page. */
  resize(): void {
    const { clientWidth: width, clientHeight: height } = this.canvas.parentElement!;
    if (width === 0 || height === 0 || this.renderer.xr.isPresenting) return;
    this.renderer.setSize(width, height, false);
    this.camera.aspect = width / height;
    // The middle of what the panels leave.
    if (width > NARROW) this.camera.setViewOffset(width, height, (PANELS.right - PANELS.left) / 2, -PANELS.top / 2, width, height);
    else this.camera.clearViewOffset();
    this.camera.updateProjectionMatrix();
    this.draw(false);
  }

  private addLight(): void {
    const { key } = this;
    key.position.set(0.9, 2.2, 0.5);
    key.castShadow = true;
    key.shadow.mapSize.set(1024, 1024);
    Object.assign(key.shadow.camera, { left: -0.75, right: 0.75, top: 0.75, bottom: -0.75, near: 0.4, far: 4.5 });
    key.shadow.bias = -0.0006;
    key.shadow.normalBias = 0.005;
    key.shadow.radius = 4;
    const fill = new DirectionalLight("#a9c8ff", 0.8);
    fill.position.set(-1.5, 0.8, 1.2);
    const rim = new DirectionalLight("#ffffff", 1.1);
    rim.position.set(-0.6, 1.1, -1.6);
    this.scene.add(key, key.target, fill, rim, new HemisphereLight("#c4d7f2", "#4a4038", 1.35));
  }

  private addSky(): void {
    const material = new ShaderMaterial({
      side: BackSide,
      depthWrite: false,
      toneMapped: false,
      uniforms: { top: { value: SKY.top }, horizon: { value: SKY.horizon } },
      vertexShader: `varying vec3 at; void main() { at = position; gl_Position = projectionMatrix * modelViewMatrix * vec4(position, 1.0); }`,
      fragmentShader: `uniform vec3 top, horizon; varying vec3 at;
        void main() {
          float height = normalize(at).y;
          vec3 sky = mix(horizon, top, smoothstep(-0.05, 0.75, abs(height)));
          gl_FragColor = vec4(sky, 1.0);
          #include <colorspace_fragment>
        }`,
    });
    const sky = new Mesh(new SphereGeometry(30, 24, 16), material);
    sky.name = "sky";
    sky.renderOrder = -1;
    this.scene.add(sky);
  }

  /** A disc of rings, a meter apart, that fades into the distance. */
  private addGround(): void {
    const size = 1024;
    const canvas = document.createElement("canvas");
    canvas.width = canvas.height = size;
    const context = canvas.getContext("2d")!;
    context.fillStyle = "#4b5664";
    context.fillRect(0, 0, size, size);
    context.strokeStyle = "rgba(255, 255, 255, 0.09)";
    context.lineWidth = 2;
    for (let ring = 1; ring <= 6; ring++) {
      context.beginPath();
      context.arc(size / 2, size / 2, (ring * size) / 12, 0, 2 * Math.PI);
      context.stroke();
    }
    context.globalCompositeOperation = "destination-in";
    const fade = context.createRadialGradient(size / 2, size / 2, 0, size / 2, size / 2, size / 2);
    fade.addColorStop(0, "rgba(0, 0, 0, 0.95)");
    fade.addColorStop(0.35, "rgba(0, 0, 0, 0.75)");
    fade.addColorStop(1, "rgba(0, 0, 0, 0)");
    context.fillStyle = fade;
    context.fillRect(0, 0, size, size);
    const map = new CanvasTexture(canvas);
    map.colorSpace = SRGBColorSpace;
    const material = new MeshStandardMaterial({ map, transparent: true, roughness: 0.95, depthWrite: false });
    const disc = new Mesh(new CircleGeometry(6, 64).rotateX(-Math.PI / 2), material);
    disc.name = "ground";
    disc.receiveShadow = true;
    this.ground.add(disc);
  }

  /** Moves the light with the object, around which shadows are sharp. */
  lightAt(center: Vector3): void {
    this.key.target.position.copy(center);
    this.key.position.copy(center).add(new Vector3(0.9, 2.2, 0.5));
  }
}
