// How layers look: translucent surfaces that are clear face-on and firm at their outline, matt sheets, plain curves.
import * as THREE from 'three';

// Opacity grows toward the outline, so that what is inside stays legible and the shape still reads as a solid.
export function glass(colour) {
  const material = new THREE.MeshStandardMaterial({
    color: colour, roughness: 0.55, metalness: 0, transparent: true, depthWrite: false, side: THREE.FrontSide,
  });
  material.userData.clarity = { value: 0.3 };
  material.onBeforeCompile = (shader) => {
    shader.uniforms.clarity = material.userData.clarity;
    shader.fragmentShader = shader.fragmentShader
      .replace('void main() {', 'uniform float clarity;\nvoid main() {')
      .replace('#include <opaque_fragment>', `
        float facing = abs(dot(normalize(vNormal), normalize(vViewPosition)));
        float edge = pow(1.0 - facing, 2.6);
        float solid = smoothstep(0.9, 1.0, clarity);
        outgoingLight *= mix(1.0 - 0.42 * edge, 1.0, solid);
        diffuseColor.a = clamp(mix(clarity * 0.42 + 0.75 * edge * min(1.0, clarity * 2.2), 1.0, solid), 0.0, 1.0);
        #include <opaque_fragment>`);
  };
  return material;
}

export function setClarity(material, value) {
  material.userData.clarity.value = value;
  const solid = value > 0.985;
  material.depthWrite = solid;
  material.transparent = !solid;
  material.needsUpdate = true;
}

export function sheet(colour) {
  return new THREE.MeshStandardMaterial({
    color: colour, roughness: 0.75, metalness: 0, side: THREE.DoubleSide,
    polygonOffset: true, polygonOffsetFactor: 1, polygonOffsetUnits: 1,
  });
}

export function solid(colour) {
  return new THREE.MeshStandardMaterial({ color: colour, roughness: 0.5, metalness: 0, side: THREE.DoubleSide });
}

// A colour scale as stops of [r, g, b] bytes, evenly spaced.
export function colourAt(stops, t, out) {
  const x = Math.min(1, Math.max(0, t)) * (stops.length - 1);
  const i = Math.min(stops.length - 2, Math.floor(x));
  const f = x - i;
  return out.setRGB(
    (stops[i][0] + (stops[i + 1][0] - stops[i][0]) * f) / 255,
    (stops[i][1] + (stops[i + 1][1] - stops[i][1]) * f) / 255,
    (stops[i][2] + (stops[i + 1][2] - stops[i][2]) * f) / 255,
    THREE.SRGBColorSpace,
  );
}
