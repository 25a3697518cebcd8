// A headset by WebXR: the controller moves the hand while it is squeezed, the stick
// drives the chair, the images are flat panels in the room. Loaded only when
// a user enters VR.
//
// The headset's own frames run the page: a headset that shows nothing sends
// nothing. The end of the session, a lost pose or a hidden session release everything.

import { Clutch } from "./clutch.js";
import { shaped } from "../logic/gamepad.js";
import { still } from "../logic/motions.js";
import { Hud } from "./hud.js";
import { Painter, facing, hit } from "./panels.js";

/** Numbers of the buttons of "xr-standard". */
const TRIGGER = 0;
const SQUEEZE = 1;
const STOP = 4;
const OPEN = 5;

const list = ({ x, y, z }) => [x, y, z];
const quaternion = ({ x, y, z, w }) => [x, y, z, w];
const down = (pad, index) => Boolean(pad?.buttons[index]) && (pad.buttons[index].pressed || pad.buttons[index].value > 0.5);

export class Headset {
  /** Requests a session; `ended` is called when it is over. */
  static async enter(app, ended) {
    const session = await navigator.xr.requestSession("immersive-vr", { optionalFeatures: ["local-floor"] });
    try {
      const headset = new Headset(app, session, ended);
      await headset.begin();
      return headset;
    } catch (error) {
      session.end().catch(() => {});
      throw error;
    }
  }

  constructor(app, session, ended) {
    this.app = app;
    this.session = session;
    this.ended = ended;
    this.clutches = new Map();
    this.held = new Map();
    this.tracked = new Set();
    this.placed = false;
    this.over = false;
    this.hud = new Hud(app);
    session.addEventListener("end", () => this.end());
    session.addEventListener("visibilitychange", () => {
      if (session.visibilityState !== "visible") this.letGo("The headset shows something else: everything stops");
    });
  }

  async begin() {
    const canvas = document.createElement("canvas");
    const gl = canvas.getContext("webgl2", { xrCompatible: true });
    if (!gl) throw new Error("this browser has no WebGL 2");
    await gl.makeXRCompatible();
    this.gl = gl;
    this.layer = new XRWebGLLayer(this.session, gl);
    await this.session.updateRenderState({ baseLayer: this.layer });
    this.space = await this.session.requestReferenceSpace("local-floor").catch(() => this.session.requestReferenceSpace("local"));
    this.painter = new Painter(gl);
    this.session.requestAnimationFrame((time, frame) => this.frame(frame));
  }

  end() {
    if (this.over) return;
    this.over = true;
    this.letGo("");
    this.ended();
  }

  letGo(words) {
    for (const clutch of this.clutches.values()) clutch.drop();
    this.app.driver.release("vr");
    this.app.driver.guard("lost_device", words);
    if (this.app.driver.moving) this.app.driver.stop("lost_device", "vr");
    this.app.flush();
  }

  /** Shows a decoded image on its panel. */
  paint(header, image) {
    this.painter?.setImage(header.camera, image);
  }

  frame(frame) {
    if (this.over) return;
    this.session.requestAnimationFrame((time, next) => this.frame(next));
    const pose = frame.getViewerPose(this.space);
    const at = this.app.now();
    if (pose && this.session.visibilityState === "visible") {
      if (!this.placed) this.place(pose);
      this.inputs(frame, pose, at);
    } else if (this.app.driver.anything()) this.letGo("The headset lost its place: everything stops");
    // Painting, rights and messages as on the flat page.
    this.app.frame(at);
    if (pose) this.draw(pose, at);
  }

  /** Places the panels in front of the first view direction; they stay there. */
  place(pose) {
    this.placed = true;
    const { position, orientation } = pose.transform;
    const from = list(position);
    const heading = quaternion(orientation);
    this.panels = this.app.stage.shown().slice(0, 2).map((camera, index, all) => ({
      camera, ...facing(from, heading, all.length === 1 ? 0 : index === 0 ? 0.46 : -0.46, 0.12, 1.7, [1.5, 0.84]),
    }));
    this.hudPanel = facing(from, heading, 0, -0.52, 1.5, [1.5, 0.5]);
  }

  inputs(frame, viewer, at) {
    const { app } = this;
    const axes = still();
    let clutch;
    let lost = false;
    this.ray = null;
    const present = new Set([...this.session.inputSources].map((source) => source.handedness));
    for (const [hand, clutch_] of this.clutches) {
      if (present.has(hand) || !clutch_.engaged) continue;
      lost = true;
      clutch_.drop();
    }
    for (const source of this.session.inputSources) {
      const pad = source.gamepad;
      if (!pad || !source.gripSpace) continue;
      const grip = frame.getPose(source.gripSpace, this.space);
      const pose = this.isTracked(source.handedness, grip)
        ? { position: list(grip.transform.position), orientation: quaternion(grip.transform.orientation) } : null;
      const own = this.clutchOf(source.handedness);
      const was = own.engaged;
      const moved = own.frame(down(pad, SQUEEZE), pose, quaternion(viewer.transform.orientation));
      if (was && !moved && !pose) lost = true;
      if (moved && !clutch) clutch = moved;
      const stick = pad.axes.length > 3 ? [pad.axes[2], pad.axes[3]] : [pad.axes[0] || 0, pad.axes[1] || 0];
      axes.chair[0] += -shaped(stick[1]);
      axes.chair[1] += -shaped(stick[0]);
      if (this.fresh(source.handedness, "stop", down(pad, STOP))) app.stop("vr");
      const onHud = this.pointed(frame, source);
      const pulled = down(pad, TRIGGER);
      const fresh = this.fresh(source.handedness, "trigger", pulled);
      if (onHud && fresh && !was) this.press(onHud);
      else if (pulled && !this.pressing) axes.grip -= 1;
      if (!pulled) this.pressing = false;
      if (down(pad, OPEN)) axes.grip += 1;
    }
    if (lost) {
      this.letGo("The controller is lost: squeeze again when it is tracked");
      return;
    }
    const clamp = (value) => Math.max(-1, Math.min(1, value));
    app.driver.set("vr", { ...axes, chair: axes.chair.map(clamp), grip: clamp(axes.grip) }, "vr", at, { mode: "stream", clutch });
  }

  /**
   * Whether the controller is tracked. Some headsets report "emulated" only
   * while they guess its position; others always do, which means nothing.
   */
  isTracked(hand, pose) {
    if (!pose) return false;
    if (!pose.emulatedPosition) this.tracked.add(hand);
    return !(pose.emulatedPosition && this.tracked.has(hand));
  }

  clutchOf(hand) {
    if (!this.clutches.has(hand)) this.clutches.set(hand, new Clutch());
    return this.clutches.get(hand);
  }

  fresh(hand, name, isDown) {
    const key = `${hand}:${name}`;
    const was = this.held.get(key);
    this.held.set(key, isDown);
    return isDown && !was;
  }

  pointed(frame, source) {
    const ray = frame.getPose(source.targetRaySpace, this.space);
    if (!ray || !this.hudPanel) return null;
    const place = hit(this.hudPanel, list(ray.transform.position), quaternion(ray.transform.orientation));
    if (!place) return null;
    this.ray = place;
    return this.hud.at(place.u, place.v);
  }

  press(item) {
    this.pressing = true;
    if (item === "leave") this.session.end();
    else this.app.activate(item, "vr");
  }

  draw(pose, at) {
    const { gl, layer } = this;
    gl.bindFramebuffer(gl.FRAMEBUFFER, layer.framebuffer);
    gl.clearColor(0.06, 0.07, 0.09, 1);
    gl.clear(gl.COLOR_BUFFER_BIT | gl.DEPTH_BUFFER_BIT);
    this.painter.hud(this.hud.canvas(at, this.ray));
    for (const view of pose.views) {
      const { x, y, width, height } = layer.getViewport(view);
      gl.viewport(x, y, width, height);
      for (const panel of this.panels || []) this.painter.draw(panel.camera, panel, view);
      if (this.hudPanel) this.painter.draw("hud", this.hudPanel, view);
    }
  }
}
