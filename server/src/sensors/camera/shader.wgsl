// Forward shading, one light with a shadow map, light from above and below.
// Body and material of a pixel arrive as flat varyings: on a CPU adapter a buffer load
// per pixel costs more than the interpolation.

override TEXTURED: bool = false;
// The sun may reach the surface.
override SUNNY: bool = true;
// Shadow map look-ups per pixel: 0, 1, 3, 9 or 16.
override SHADOW_TAPS: u32 = 1u;
// The alpha byte holds the instance id; not when samples are averaged.
override ID_IN_ALPHA: bool = true;
// A look is rendered: ambient light by the normal, and lamps.
override LIT: bool = false;
// Mirrors the room.
override MIRRORS: bool = false;
// Number of capsules that occlude ambient light: 0, 1, 2, 4 or 8.
override NEAR: u32 = 0u;
// Ambient occlusion is sampled from the ambient map; else interpolated between vertices.
override MAPPED: bool = true;

struct Lamp { at: vec4<f32>, color: vec4<f32> }

struct Camera {
    clip_from_world: mat4x4<f32>,
    shadow_from_world: mat4x4<f32>,
    eye: vec4<f32>,
    sun_direction: vec4<f32>,
    sun: vec4<f32>,
    sky: vec4<f32>,
    ground: vec4<f32>,
    // Size of a shadow texel in the map and in the world; number of lamps.
    shadow_texel: vec4<f32>,
    // Light from all around on a normal n: (n, 1)ᵀ M (n, 1).
    irradiance: array<mat4x4<f32>, 3>,
    lamps: array<Lamp, 4>,
}

// Rows of world_from_body; id and ambient occlusion (1: open).
struct Body { x: vec4<f32>, y: vec4<f32>, z: vec4<f32>, more: vec4<f32> }
// Linear colour and roughness; metallic, emission, texture layer.
struct Material { color: vec4<f32>, more: vec4<f32> }

@group(0) @binding(0) var<uniform> camera: Camera;
@group(0) @binding(1) var<storage, read> bodies: array<Body>;
@group(0) @binding(2) var<storage, read> materials: array<Material>;
@group(0) @binding(3) var images: texture_2d_array<f32>;
@group(0) @binding(4) var repeating: sampler;
// Environment map, octahedral; square roots of shares of 6.
@group(0) @binding(5) var reflection: texture_2d<f32>;
@group(0) @binding(6) var smooth_levels: sampler;
// Ambient light of wide static planes.
@group(0) @binding(7) var ambient_map: texture_2d<f32>;
@group(0) @binding(8) var one_level: sampler;
@group(1) @binding(0) var shadow_map: texture_depth_2d;
@group(1) @binding(1) var shadow_sampler: sampler_comparison;

// A capsule that approximates a movable object, in coordinates of a plane, metres.
struct Occluder {
    // Centre and axis, projected on the plane.
    place: vec4<f32>,
    // Height of the centre above the plane, rise of the axis, their product, half the
    // distance between the centres of the caps.
    heights: vec4<f32>,
    // 1 / reach² and strength.
    fading: vec4<f32>,
}

// Capsules near the rendered triangles; width and height of the ambient map, metres.
struct Contacts { extent: vec4<f32>, occluders: array<Occluder, 8> }

@group(2) @binding(0) var<uniform> contacts: Contacts;

// `Contacts` of one draw; the third component of `extent` is the number of capsules.
struct DrawContacts { extent: vec4<f32>, occluders: array<Occluder, 8>, unused: array<vec4<f32>, 7> }

@group(2) @binding(0) var<storage, read> draw_contacts: array<DrawContacts>;

struct Vertex {
    @location(0) position: vec3<f32>,
    // Octahedral.
    @location(1) normal: vec2<f32>,
    @location(2) uv: vec2<f32>,
    // Body: 12 bits, ambient occlusion: 8 bits, material: 12 bits.
    @location(3) packed: u32,
    @location(4) ambient: vec2<f32>,
}

struct Varying {
    @builtin(position) @invariant clip: vec4<f32>,
    @location(0) normal: vec3<f32>,
    // From the surface to the eye; ambient occlusion.
    @location(1) view: vec4<f32>,
    @location(2) uv: vec2<f32>,
    @location(3) shadow: vec3<f32>,
    @location(4) @interpolate(flat) color: vec4<f32>,
    @location(5) @interpolate(flat) more: vec4<f32>,
}

fn to_world(body: u32, p: vec3<f32>) -> vec3<f32> {
    let q = vec4(p, 1.0);
    return vec3(dot(bodies[body].x, q), dot(bodies[body].y, q), dot(bodies[body].z, q));
}

fn decode(n: vec2<f32>) -> vec3<f32> {
    var v = vec3(n, 1.0 - abs(n.x) - abs(n.y));
    let t = max(-v.z, 0.0);
    v.x += select(t, -t, v.x >= 0.0);
    v.y += select(t, -t, v.y >= 0.0);
    return normalize(v);
}

struct Lit {
    world: vec3<f32>,
    normal: vec3<f32>,
    // Coordinates in the shadow map.
    shadow: vec3<f32>,
    // Share of the surroundings that lights this vertex.
    ambient_occlusion: f32,
}

fn place(v: Vertex, body: u32) -> Lit {
    let b = bodies[body];
    let n = decode(v.normal);
    var out: Lit;
    out.world = to_world(body, v.position);
    out.normal = vec3(dot(b.x.xyz, n), dot(b.y.xyz, n), dot(b.z.xyz, n));
    out.ambient_occlusion = f32((v.packed >> 12u) & 0xffu) * (1.0 / 255.0) * b.more.y;
    // A little outside the surface, more where the light grazes it.
    let slope = 1.0 - abs(dot(out.normal, camera.sun_direction.xyz));
    let wider = select(1.0, 1.7, SHADOW_TAPS == 16u);
    let outside = out.world + out.normal * (wider * camera.shadow_texel.y * (0.6 + 1.8 * slope));
    let s = camera.shadow_from_world * vec4(outside, 1.0);
    out.shadow = vec3(s.xy * vec2(0.5, -0.5) + 0.5, s.z);
    return out;
}

// Light from all around and from the lamps.
fn surrounding(lit: Lit) -> vec3<f32> {
    let n = vec4(lit.normal, 1.0);
    var light = vec3(
        dot(n, camera.irradiance[0] * n),
        dot(n, camera.irradiance[1] * n),
        dot(n, camera.irradiance[2] * n),
    );
    for (var i = 0; i < i32(camera.shadow_texel.z); i++) {
        let to = camera.lamps[i].at.xyz - lit.world;
        let square = dot(to, to);
        // A lampshade is not a point source: it lights a little around the edge.
        let cosine = max(0.8 * dot(lit.normal, to) * inverseSqrt(square + 1e-4) + 0.2, 0.0);
        light += camera.lamps[i].color.rgb * (cosine / (square + 0.35));
    }
    return max(light, vec3(0.0));
}

@vertex fn surface(v: Vertex) -> Varying {
    let body = v.packed & 0xfffu;
    let m = materials[v.packed >> 20u];
    let lit = place(v, body);
    var out: Varying;
    out.clip = camera.clip_from_world * vec4(lit.world, 1.0);
    out.normal = lit.normal;
    out.view = vec4(camera.eye.xyz - lit.world, lit.ambient_occlusion);
    out.uv = v.uv;
    out.shadow = lit.shadow;
    out.color = m.color;
    out.more = vec4(m.more.xyz, bodies[body].more.x);
    return out;
}

struct LitVarying {
    @builtin(position) @invariant clip: vec4<f32>,
    @location(0) normal: vec3<f32>,
    @location(1) view: vec4<f32>,
    @location(2) uv: vec2<f32>,
    @location(3) shadow: vec3<f32>,
    @location(4) @interpolate(flat) color: vec4<f32>,
    @location(5) @interpolate(flat) more: vec4<f32>,
    // Light from all around.
    @location(6) around: vec3<f32>,
}

@vertex fn lit_surface(v: Vertex) -> LitVarying {
    let body = v.packed & 0xfffu;
    let m = materials[v.packed >> 20u];
    let lit = place(v, body);
    var out: LitVarying;
    out.clip = camera.clip_from_world * vec4(lit.world, 1.0);
    out.normal = lit.normal;
    out.view = vec4(camera.eye.xyz - lit.world, lit.ambient_occlusion);
    out.uv = v.uv;
    out.shadow = lit.shadow;
    out.color = m.color;
    out.more = vec4(m.more.xyz, bodies[body].more.x);
    out.around = surrounding(lit);
    return out;
}

// Matte surfaces are lit at their vertices; a pixel only looks up image and shadow.
struct MatteVarying {
    @builtin(position) @invariant clip: vec4<f32>,
    // Ambient light; light of the sun when nothing occludes it.
    @location(0) light: vec4<f32>,
    @location(1) uv: vec2<f32>,
    @location(2) shadow: vec3<f32>,
    // Colour and instance id.
    @location(3) @interpolate(flat) color: vec4<f32>,
    @location(4) @interpolate(flat) layer: f32,
}

@vertex fn matte_surface(v: Vertex) -> MatteVarying {
    let body = v.packed & 0xfffu;
    let m = materials[v.packed >> 20u];
    let lit = place(v, body);
    var around = mix(camera.ground.rgb, camera.sky.rgb, 0.5 + 0.5 * lit.normal.z);
    if LIT {
        around = surrounding(lit);
    }
    var out: MatteVarying;
    out.clip = camera.clip_from_world * vec4(lit.world, 1.0);
    out.light = vec4(
        around * lit.ambient_occlusion + m.more.y,
        max(dot(lit.normal, camera.sun_direction.xyz), 0.0),
    );
    out.uv = v.uv;
    out.shadow = lit.shadow;
    // Rough surfaces still mirror a little of the environment.
    out.color = vec4(m.color.rgb + 0.03, bodies[body].more.x);
    out.layer = m.more.z;
    return out;
}

// Share of the ambient light of a vertex that pixels multiply further.
fn vertex_share(lit: Lit, body: u32, mapped: bool) -> f32 {
    if mapped {
        return bodies[body].more.y;
    }
    return lit.ambient_occlusion;
}

// As MatteVarying, with ambient occlusion per pixel.
struct MappedMatte {
    @builtin(position) @invariant clip: vec4<f32>,
    @location(0) light: vec4<f32>,
    // Coordinates in the texture and in the ambient map.
    @location(1) uv: vec4<f32>,
    @location(2) shadow: vec3<f32>,
    @location(3) @interpolate(flat) color: vec4<f32>,
    // Texture layer and emission.
    @location(4) @interpolate(flat) more: vec2<f32>,
}

fn mapped_matte(v: Vertex, mapped: bool) -> MappedMatte {
    let body = v.packed & 0xfffu;
    let m = materials[v.packed >> 20u];
    let lit = place(v, body);
    var around = mix(camera.ground.rgb, camera.sky.rgb, 0.5 + 0.5 * lit.normal.z);
    if LIT {
        around = surrounding(lit);
    }
    var out: MappedMatte;
    out.clip = camera.clip_from_world * vec4(lit.world, 1.0);
    out.light = vec4(
        around * vertex_share(lit, body, mapped),
        max(dot(lit.normal, camera.sun_direction.xyz), 0.0),
    );
    out.uv = vec4(v.uv, v.ambient);
    out.shadow = lit.shadow;
    out.color = vec4(m.color.rgb + 0.03, bodies[body].more.x);
    out.more = vec2(m.more.z, m.more.y);
    return out;
}

@vertex fn mapped_matte_surface(v: Vertex) -> MappedMatte {
    return mapped_matte(v, MAPPED);
}

// As MappedMatte, with the source of the ambient light of the draw: the lowest bit is set if
// pixels sample the ambient map, the others are the index of the contacts, 0 for none.
struct DrawnMatte {
    @builtin(position) @invariant clip: vec4<f32>,
    @location(0) light: vec4<f32>,
    @location(1) uv: vec4<f32>,
    @location(2) shadow: vec3<f32>,
    @location(3) @interpolate(flat) color: vec4<f32>,
    @location(4) @interpolate(flat) more: vec2<f32>,
    @location(5) @interpolate(flat) source: u32,
}

@vertex fn drawn_matte_surface(v: Vertex, @builtin(instance_index) source: u32) -> DrawnMatte {
    let m = mapped_matte(v, (source & 1u) != 0u);
    var out = DrawnMatte(m.clip, m.light, m.uv, m.shadow, m.color, m.more, source);
    if source == 0u {
        // As `matte_surface`.
        out.light = vec4(m.light.rgb + m.more.y, m.light.a);
        out.more.y = 0.0;
    }
    return out;
}

// As LitVarying; the fourth component of `view` is `vertex_share`.
struct MappedVarying {
    @builtin(position) @invariant clip: vec4<f32>,
    @location(0) normal: vec3<f32>,
    @location(1) view: vec4<f32>,
    @location(2) uv: vec4<f32>,
    @location(3) shadow: vec3<f32>,
    @location(4) @interpolate(flat) color: vec4<f32>,
    @location(5) @interpolate(flat) more: vec4<f32>,
    @location(6) around: vec3<f32>,
}

fn mapped_varying(v: Vertex, mapped: bool) -> MappedVarying {
    let body = v.packed & 0xfffu;
    let m = materials[v.packed >> 20u];
    let lit = place(v, body);
    var out: MappedVarying;
    out.clip = camera.clip_from_world * vec4(lit.world, 1.0);
    out.normal = lit.normal;
    out.view = vec4(camera.eye.xyz - lit.world, vertex_share(lit, body, mapped));
    out.uv = vec4(v.uv, v.ambient);
    out.shadow = lit.shadow;
    out.color = m.color;
    out.more = vec4(m.more.xyz, bodies[body].more.x);
    out.around = vec3(0.0);
    if LIT {
        out.around = surrounding(lit);
    }
    return out;
}

@vertex fn mapped_surface(v: Vertex) -> MappedVarying {
    return mapped_varying(v, MAPPED);
}

// As MappedVarying, with the source of the ambient light of the draw.
struct DrawnVarying {
    @builtin(position) @invariant clip: vec4<f32>,
    @location(0) normal: vec3<f32>,
    @location(1) view: vec4<f32>,
    @location(2) uv: vec4<f32>,
    @location(3) shadow: vec3<f32>,
    @location(4) @interpolate(flat) color: vec4<f32>,
    @location(5) @interpolate(flat) more: vec4<f32>,
    @location(6) around: vec3<f32>,
    @location(7) @interpolate(flat) source: u32,
}

@vertex fn drawn_surface(v: Vertex, @builtin(instance_index) source: u32) -> DrawnVarying {
    let m = mapped_varying(v, (source & 1u) != 0u);
    return DrawnVarying(
        m.clip, m.normal, m.view, m.uv, m.shadow, m.color, m.more, m.around, source,
    );
}

// Far from the sun, in the part of the shadow map that is rendered again.
@vertex fn erase(@builtin(vertex_index) i: u32) -> @builtin(position) vec4<f32> {
    return vec4(f32(i & 1u) * 4.0 - 1.0, f32(i >> 1u) * 4.0 - 1.0, 1.0, 1.0);
}

struct Place { @location(0) position: vec3<f32>, @location(3) packed: u32 }

@vertex fn caster(v: Place) -> @builtin(position) vec4<f32> {
    return camera.shadow_from_world * vec4(to_world(v.packed & 0xfffu, v.position), 1.0);
}

struct Identified {
    @builtin(position) @invariant clip: vec4<f32>,
    @location(0) @interpolate(flat) id: f32,
}

@vertex fn outline(v: Place) -> Identified {
    let body = v.packed & 0xfffu;
    return Identified(camera.clip_from_world * vec4(to_world(body, v.position), 1.0), bodies[body].more.x);
}

@fragment fn identify(v: Identified) -> @location(0) u32 {
    return u32(v.id + 0.5);
}

// Content of the alpha byte.
fn alpha(id: f32) -> f32 {
    return select(1.0, id * (1.0 / 255.0), ID_IN_ALPHA);
}

// Three bilinear look-ups about the point, none in the row or column of another: an edge
// of any direction becomes a ramp of three texels. On a CPU adapter each costs 7 % of the
// rate; four in a square look no better.
fn three_taps(at: vec3<f32>) -> f32 {
    let texel = camera.shadow_texel.x;
    let a = at.xy + texel * vec2(0.9, 0.35);
    let b = at.xy + texel * vec2(-0.75, 0.6);
    let c = at.xy + texel * vec2(-0.15, -0.95);
    return (textureSampleCompareLevel(shadow_map, shadow_sampler, a, at.z)
        + textureSampleCompareLevel(shadow_map, shadow_sampler, b, at.z)
        + textureSampleCompareLevel(shadow_map, shadow_sampler, c, at.z)) * (1.0 / 3.0);
}

fn sunlit(at: vec3<f32>) -> f32 {
    if SHADOW_TAPS == 0u {
        return 1.0;
    }
    if SHADOW_TAPS == 1u {
        return textureSampleCompareLevel(shadow_map, shadow_sampler, at.xy, at.z);
    }
    if SHADOW_TAPS == 3u {
        return three_taps(at);
    }
    if SHADOW_TAPS == 16u {
        var all = 0.0;
        for (var i = 0; i < 4; i++) {
            for (var j = 0; j < 4; j++) {
                let offset = vec2(f32(i) - 1.5, f32(j) - 1.5) * (1.8 * camera.shadow_texel.x);
                all += textureSampleCompareLevel(shadow_map, shadow_sampler, at.xy + offset, at.z);
            }
        }
        return all * (1.0 / 16.0);
    }
    var sum = 0.0;
    for (var i = -1; i <= 1; i++) {
        for (var j = -1; j <= 1; j++) {
            let offset = vec2(f32(i), f32(j)) * (1.5 * camera.shadow_texel.x);
            sum += textureSampleCompareLevel(shadow_map, shadow_sampler, at.xy + offset, at.z);
        }
    }
    return sum * (1.0 / 9.0);
}

// Filmic curve with the display's gamma in it (Hejl and Burgess-Dawson, 2010),
// with a longer toe.
fn display(c: vec3<f32>) -> vec3<f32> {
    return (c * (6.2 * c + 0.5)) / (c * (6.2 * c + 1.7) + 0.06);
}

fn image(uv: vec2<f32>, layer: f32) -> vec3<f32> {
    // Stored as square roots.
    let root = textureSample(images, repeating, uv, i32(layer)).rgb;
    return root * root;
}

// Share of the ambient light at a point of a plane that a capsule does not occlude. The
// nearest sphere of the capsule counts. A fourth power fades about as the exact share of a
// sphere, without a division.
fn unoccluded_share(o: Occluder, p: vec2<f32>) -> f32 {
    let offset = p - o.place.xy;
    let along = clamp(dot(offset, o.place.zw) - o.heights.z, -o.heights.w, o.heights.w);
    let to = o.place.zw * along - offset;
    let height = max(o.heights.x + o.heights.y * along, 0.0);
    let fade = max(1.0 - (dot(to, to) + height * height) * o.fading.x, 0.0);
    let square = fade * fade;
    return 1.0 - height * o.fading.y * (square * square);
}

// Share of the ambient light that reaches a pixel, by its coordinates in the ambient map;
// what its vertices know is not included. Unrolled: a CPU adapter executes both sides of a
// branch, and gathers reads whose index is not constant.
fn ambient_share(at: vec2<f32>) -> f32 {
    var share = 1.0;
    if MAPPED {
        share = textureSampleLevel(ambient_map, one_level, at, 0.0).r;
    }
    let p = at * contacts.extent.xy;
    if NEAR > 0u {
        share *= unoccluded_share(contacts.occluders[0], p);
    }
    if NEAR > 1u {
        share *= unoccluded_share(contacts.occluders[1], p);
    }
    if NEAR > 2u {
        share *= unoccluded_share(contacts.occluders[2], p)
            * unoccluded_share(contacts.occluders[3], p);
    }
    if NEAR > 4u {
        share *= unoccluded_share(contacts.occluders[4], p)
            * unoccluded_share(contacts.occluders[5], p);
        share *= unoccluded_share(contacts.occluders[6], p)
            * unoccluded_share(contacts.occluders[7], p);
    }
    return share;
}

// As `ambient_share`, by the source of the draw: for a GPU, where a branch costs less than a
// change of the pipeline. The products are those of `ambient_share`: unused capsules have
// the factor 1.
fn drawn_share(at: vec2<f32>, source: u32) -> f32 {
    var share = 1.0;
    if (source & 1u) != 0u {
        share = textureSampleLevel(ambient_map, one_level, at, 0.0).r;
    }
    let list = source >> 1u;
    if list > 0u {
        let extent = draw_contacts[list].extent;
        let p = at * extent.xy;
        share *= unoccluded_share(draw_contacts[list].occluders[0], p);
        share *= unoccluded_share(draw_contacts[list].occluders[1], p);
        if extent.z > 2.0 {
            share *= unoccluded_share(draw_contacts[list].occluders[2], p)
                * unoccluded_share(draw_contacts[list].occluders[3], p);
        }
        if extent.z > 4.0 {
            share *= unoccluded_share(draw_contacts[list].occluders[4], p)
                * unoccluded_share(draw_contacts[list].occluders[5], p);
            share *= unoccluded_share(draw_contacts[list].occluders[6], p)
                * unoccluded_share(draw_contacts[list].occluders[7], p);
        }
    }
    return share;
}

@fragment fn mapped_matte_shade(v: MappedMatte) -> @location(0) vec4<f32> {
    return matte_color(v, ambient_share(v.uv.zw));
}

@fragment fn drawn_matte_shade(v: DrawnMatte) -> @location(0) vec4<f32> {
    let own = MappedMatte(v.clip, v.light, v.uv, v.shadow, v.color, v.more);
    return matte_color(own, drawn_share(v.uv.zw, v.source));
}

// `open`: share of the ambient light that reaches the pixel.
fn matte_color(v: MappedMatte, open: f32) -> vec4<f32> {
    var base = v.color.rgb;
    if TEXTURED {
        base *= image(v.uv.xy, v.more.x);
    }
    var light = v.light.rgb * open + v.more.y;
    if SUNNY {
        light += camera.sun.rgb * (v.light.a * sunlit(v.shadow));
    }
    let c = base * light;
    return vec4(display(c), alpha(v.color.a));
}

@fragment fn matte_shade(v: MatteVarying) -> @location(0) vec4<f32> {
    var base = v.color.rgb;
    if TEXTURED {
        base *= image(v.uv, v.layer);
    }
    var light = v.light.rgb;
    if SUNNY {
        light += camera.sun.rgb * (v.light.a * sunlit(v.shadow));
    }
    let c = base * light;
    return vec4(display(c), alpha(v.color.a));
}

@fragment fn shade(v: Varying) -> @location(0) vec4<f32> {
    return glossy(v, v.view.w);
}

@fragment fn mapped_shade(v: MappedVarying) -> @location(0) vec4<f32> {
    let open = ambient_share(v.uv.zw);
    let own = Varying(v.clip, v.normal, v.view, v.uv.xy, v.shadow, v.color, v.more);
    return glossy(own, v.view.w * open);
}

@fragment fn drawn_shade(v: DrawnVarying) -> @location(0) vec4<f32> {
    let open = drawn_share(v.uv.zw, v.source);
    let own = Varying(v.clip, v.normal, v.view, v.uv.xy, v.shadow, v.color, v.more);
    return glossy(own, v.view.w * open);
}

// `open`: share of the ambient light that reaches the pixel.
fn glossy(v: Varying, open: f32) -> vec4<f32> {
    var base = v.color.rgb;
    if TEXTURED {
        base *= image(v.uv, v.more.z);
    }
    let metallic = v.more.x;
    let roughness = v.color.a;
    let n = normalize(v.normal);
    let view = normalize(v.view.xyz);
    let sun = camera.sun_direction.xyz;
    let nl = max(dot(n, sun), 0.0);
    let nv = max(dot(n, view), 0.0);
    let f0 = mix(vec3(0.04), base, metallic);
    let matte = base * (1.0 - metallic);

    var direct = vec3(0.0);
    if SUNNY {
        // GGX with the visibility and Fresnel terms fitted together (Karis 2013,
        // mobile). The half vector is (view + sun) / length.
        let length2 = 2.0 + 2.0 * dot(view, sun);
        let nh = dot(n, view + sun);
        let nh2 = nh * nh / max(length2, 0.01);
        let vh2 = max(0.25 * length2, 0.01);
        let a = roughness * roughness;
        let d = nh2 * (a * a - 1.0) + 1.0;
        let glint = a * a / (d * d * vh2 * (a * 4.0 + 2.0));
        direct = camera.sun.rgb * (matte + f0 * glint) * (nl * sunlit(v.shadow));
    }

    // The room around: brighter above than below, mirrored by smooth surfaces.
    let up = 2.0 * nv * n.z - view.z;
    let facing = 1.0 - nv;
    let mirror = f0 + (1.0 - roughness) * (facing * facing * facing * facing * 0.5);
    let around = mix(camera.ground.rgb, camera.sky.rgb, 0.5 + 0.5 * n.z);
    let mirrored = mix(camera.ground.rgb, camera.sky.rgb, clamp(0.5 + up * (1.1 - 0.6 * roughness), 0.0, 1.2));
    let ambient = (matte * around + mirror * mirrored) * open;

    let c = direct + ambient + base * v.more.y;
    return vec4(display(c), alpha(v.more.w));
}

// The room in a direction, more blurred for rougher surfaces.
fn mirrored_room(towards: vec3<f32>, roughness: f32) -> vec3<f32> {
    let sum = abs(towards.x) + abs(towards.y) + abs(towards.z);
    var p = towards.xy / sum;
    if towards.z < 0.0 {
        let folded = 1.0 - abs(p.yx);
        p = select(-folded, folded, p >= vec2(0.0));
    }
    let root = textureSampleLevel(reflection, smooth_levels, p * 0.5 + 0.5, roughness * 4.0).rgb;
    return root * root * 6.0;
}

@fragment fn lit_shade(v: LitVarying) -> @location(0) vec4<f32> {
    return lit_glossy(v, v.view.w);
}

@fragment fn mapped_lit_shade(v: MappedVarying) -> @location(0) vec4<f32> {
    let open = ambient_share(v.uv.zw);
    let own = LitVarying(v.clip, v.normal, v.view, v.uv.xy, v.shadow, v.color, v.more, v.around);
    return lit_glossy(own, v.view.w * open);
}

@fragment fn drawn_lit_shade(v: DrawnVarying) -> @location(0) vec4<f32> {
    let open = drawn_share(v.uv.zw, v.source);
    let own = LitVarying(v.clip, v.normal, v.view, v.uv.xy, v.shadow, v.color, v.more, v.around);
    return lit_glossy(own, v.view.w * open);
}

// As `glossy`, with ambient light of the room.
fn lit_glossy(v: LitVarying, open: f32) -> vec4<f32> {
    var base = v.color.rgb;
    if TEXTURED {
        base *= image(v.uv, v.more.z);
    }
    let metallic = v.more.x;
    let roughness = v.color.a;
    let n = normalize(v.normal);
    let view = normalize(v.view.xyz);
    let nv = max(dot(n, view), 0.0);
    let f0 = mix(vec3(0.04), base, metallic);
    let matte = base * (1.0 - metallic);

    var direct = vec3(0.0);
    if SUNNY {
        let sun = camera.sun_direction.xyz;
        direct = camera.sun.rgb * (matte + f0 * glint(n, view, roughness))
            * (max(dot(n, sun), 0.0) * sunlit(v.shadow));
    }
    let facing = 1.0 - nv;
    let mirror = f0 + (1.0 - roughness) * (facing * facing * facing * facing * 0.5);
    var mirrored: vec3<f32>;
    if MIRRORS {
        mirrored = mirrored_room(2.0 * nv * n - view, roughness);
    } else {
        let up = 2.0 * nv * n.z - view.z;
        mirrored = mix(camera.ground.rgb, camera.sky.rgb, clamp(0.5 + up * (1.1 - 0.6 * roughness), 0.0, 1.2));
    }
    let ambient = (matte * v.around + mirror * mirrored) * open;
    let c = direct + ambient + base * v.more.y;
    return vec4(display(c), alpha(v.more.w));
}

// As in `shade`.
fn glint(n: vec3<f32>, view: vec3<f32>, roughness: f32) -> f32 {
    let sun = camera.sun_direction.xyz;
    let length2 = 2.0 + 2.0 * dot(view, sun);
    let nh = dot(n, view + sun);
    let nh2 = nh * nh / max(length2, 0.01);
    let vh2 = max(0.25 * length2, 0.01);
    let a = roughness * roughness;
    let d = nh2 * (a * a - 1.0) + 1.0;
    return a * a / (d * d * vh2 * (a * 4.0 + 2.0));
}

// Glass multiplies what is behind it: the longer the way through, the more. Both
// passes work on what is displayed, where colours are about square roots.
@fragment fn glass_tint(v: LitVarying) -> @location(0) vec4<f32> {
    let n = normalize(v.normal);
    let nv = max(dot(n, normalize(v.view.xyz)), 0.0);
    let way = 0.32 / (0.28 + nv);
    return vec4(pow(v.color.rgb, vec3(way)) * v.more.x, 1.0);
}

// And adds its mirror image, and a little of its own light.
@fragment fn glass_gloss(v: LitVarying) -> @location(0) vec4<f32> {
    let n = normalize(v.normal);
    let view = normalize(v.view.xyz);
    let nv = max(dot(n, view), 0.0);
    let facing = 1.0 - nv;
    let f = 0.04 + 0.7 * facing * facing * facing * facing * facing;
    var c = f * mirrored_room(2.0 * nv * n - view, v.color.a) * v.view.w;
    if SUNNY {
        let nl = max(dot(n, camera.sun_direction.xyz), 0.0);
        c += camera.sun.rgb * (0.04 * glint(n, view, v.color.a) * nl * sunlit(v.shadow));
    }
    c += v.color.rgb * v.around * (0.6 * (1.0 - v.more.x));
    return vec4(display(c), alpha(v.more.w));
}
