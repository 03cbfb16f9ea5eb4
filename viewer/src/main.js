// The viewer of a report. It reads two elements of the page: `scene-glb` (the exported scene, base64) and `view-settings`
// (JSON: camera, tolerance, colour stops, transform, which modes make sense). All lengths are LPS millimetres.
import * as THREE from 'three';
import { GLTFLoader } from 'three/examples/jsm/loaders/GLTFLoader.js';
import { OrbitControls } from 'three/examples/jsm/controls/OrbitControls.js';
import { glass, setClarity, sheet, solid, colourAt } from './materials.js';
import { element, checkbox, slider, select, segmented, section, number } from './controls.js';

const KINDS = [
  ['surface', 'Surface'], ['sheet', 'Sheets'], ['axial', 'Axial curves'], ['rib', 'Ribs'], ['wire', 'Wires'],
  ['seam', 'Seams'], ['node', 'Nodes'], ['correspondence', 'Correspondences'], ['mark', 'Marks'],
];
// One layer each; the others may hold many things in one.
const ELEMENTS = new Set(['sheet', 'axial', 'rib', 'wire', 'seam', 'node']);
const SHAPES = { target: 'Target', source: 'Source', baseline: 'Baseline', followup: 'Follow-up' };
const say = (text) => text.charAt(0).toUpperCase() + text.slice(1);

class Viewer {
  constructor(host, panel, settings) {
    this.host = host;
    this.panel = panel;
    this.settings = settings;
    this.layers = [];
    this.tolerance = settings.tolerance_mm ?? 0;
    this.shown = new Map(); // "kind|shape" -> boolean
    this.sheetColours = 'component';
    this.clarity = 0.3;
    // The drawing is kept so that print, screenshots of the page and "save picture" never find an empty canvas.
    this.renderer = new THREE.WebGLRenderer({ antialias: true, preserveDrawingBuffer: true });
    this.renderer.setPixelRatio(Math.min(window.devicePixelRatio || 1, 2));
    this.renderer.localClippingEnabled = true;
    this.scene = new THREE.Scene();
    this.camera = new THREE.PerspectiveCamera(26, 1, 1, 1000);
    this.world = new THREE.Group();
    this.scene.add(this.world);
    this.scene.add(new THREE.HemisphereLight(0xffffff, 0xb9c2cf, 1.7));
    const key = new THREE.DirectionalLight(0xffffff, 1.6);
    key.position.set(-0.4, 0.8, 1);
    const fill = new THREE.DirectionalLight(0xffffff, 0.5);
    fill.position.set(0.8, -0.5, 0.6);
    this.camera.add(key, fill);
    this.scene.add(this.camera);
    this.clip = new THREE.Plane(new THREE.Vector3(1, 0, 0), 0);
    this.clipAxis = 'off';
    this.clipAt = 0.5;
    this.clipFlip = false;
    host.append(this.renderer.domElement);
    this.triad = element('canvas', { className: 'triad', width: 176, height: 176, ariaHidden: 'true' });
    this.size = element('div', { className: 'size' });
    this.bars = element('div', { className: 'bars' });
    host.append(this.triad, this.size, this.bars);
    this.setBackground('light');
    this.controls = new OrbitControls(this.camera, this.renderer.domElement);
    this.controls.enableDamping = false;
    this.controls.addEventListener('change', () => this.draw());
    new ResizeObserver(() => this.resize()).observe(host);
    this.listenForPicks();
  }

  load(gltf) {
    const lps = gltf.scene.getObjectByName('LPS_mm');
    lps.updateWorldMatrix(true, false);
    this.centre = lps.position.clone();
    const meshes = [];
    lps.traverse((o) => { if (o.isMesh) meshes.push(o); });
    for (const mesh of meshes) this.addLayer(mesh);
    // Camera space is LPS mm about the scene's centre; labels add the centre back.
    this.box = new THREE.Box3();
    for (const l of this.layers) this.box.expandByObject(l.object);
    if (this.box.isEmpty()) this.box.set(new THREE.Vector3(-1, -1, -1), new THREE.Vector3(1, 1, 1));
    this.radius = 0.5 * this.box.getSize(new THREE.Vector3()).length();
    const hasInside = this.layers.some((l) => l.kind !== 'surface');
    const surfaces = this.layers.filter((l) => l.kind === 'surface' && l.data.visible !== false).length;
    this.surfaceColours = this.settings.surface_colours ?? '';
    this.clarity = hasInside ? 0.3 : surfaces > 1 && !this.surfaceColours ? 0.5 : 1;
    this.buildPanel();
    this.apply();
    this.home();
  }

  addLayer(mesh) {
    const data = mesh.userData;
    const [r, g, b] = data.colour ?? [0.7, 0.7, 0.7];
    const colour = new THREE.Color().setRGB(r, g, b, THREE.SRGBColorSpace);
    const kind = data.kind ?? 'mark';
    const layer = {
      name: mesh.name, kind, shape: data.shape ?? '', colour, data,
      properties: data.properties ?? {}, quantity: data.quantity ?? null,
      persistence: data.properties?.persistence_mm,
    };
    // userData.name keeps spaces that the loader takes out of node names.
    layer.label = data.name ?? mesh.name.replaceAll('_', ' ');
    const geometry = mesh.geometry;
    geometry.deleteAttribute('color');
    if (kind === 'surface') {
      const front = new THREE.Mesh(geometry, glass(colour));
      const back = new THREE.Mesh(geometry, glass(colour));
      back.material.side = THREE.BackSide;
      back.renderOrder = 10;
      front.renderOrder = 11;
      layer.object = new THREE.Group();
      layer.object.add(back, front);
      layer.meshes = [front, back];
    } else {
      const material = kind === 'sheet' ? sheet(colour) : solid(colour);
      layer.meshes = [new THREE.Mesh(geometry, material)];
      layer.object = layer.meshes[0];
    }
    for (const m of layer.meshes) { m.userData.layer = layer; m.material.clippingPlanes = []; }
    layer.geometry = geometry;
    this.world.add(layer.object);
    this.layers.push(layer);
    const key = `${kind}|${layer.shape}`;
    if (!this.shown.has(key)) this.shown.set(key, data.visible !== false);
  }

  // --- what is shown -----------------------------------------------------------------------------------------------

  apply() {
    for (const l of this.layers) {
      const kept = l.persistence === undefined || l.persistence === null || l.persistence >= this.tolerance - 1e-12;
      l.object.visible = (this.shown.get(`${l.kind}|${l.shape}`) ?? true) && kept;
      if (l.kind === 'sheet') this.paintSheet(l);
      if (l.kind === 'surface') this.paintSurface(l);
    }
    const planes = this.clipAxis === 'off' ? [] : [this.clip];
    for (const l of this.layers) for (const m of l.meshes) m.material.clippingPlanes = planes;
    this.placeClip();
    this.drawBars();
    this.draw();
  }

  paintSheet(l) {
    const mode = this.sheetColours;
    const material = l.meshes[0].material;
    if (mode === 'radius' && l.quantity) {
      this.paintVertices(l);
      material.vertexColors = true;
      material.color.set(0xffffff);
    } else {
      material.vertexColors = false;
      if (mode === 'persistence') {
        const [lo, hi] = this.persistenceRange();
        const t = hi > lo ? ((l.persistence ?? lo) - lo) / (hi - lo) : 0.5;
        colourAt(this.settings.scales.viridis, t, material.color);
      } else {
        material.color.copy(l.colour);
      }
    }
    material.needsUpdate = true;
  }

  paintSurface(l) {
    const ghost = Boolean(this.ghost) && l.shape === this.ghost;
    const clarity = ghost ? 0.35 : this.clarity;
    const painted = !ghost && Boolean(l.quantity) && this.surfaceColours === l.quantity.name;
    if (painted) this.paintVertices(l);
    for (const m of l.meshes) {
      m.material.vertexColors = painted;
      m.material.color.copy(painted ? new THREE.Color(0xffffff) : l.colour);
      setClarity(m.material, clarity);
    }
    // A solid surface needs no second pass for its back.
    l.meshes[1].visible = clarity < 0.985 || this.clipAxis !== 'off';
  }

  paintVertices(l) {
    if (l.painted) return;
    const q = l.quantity;
    const values = l.geometry.getAttribute(q.attribute.toLowerCase());
    const stops = this.settings.scales[q.scale];
    const colours = new Float32Array(3 * values.count);
    const c = new THREE.Color();
    const span = q.range[1] - q.range[0];
    for (let i = 0; i < values.count; i++) {
      const v = values.getX(i);
      if (Number.isNaN(v)) c.setRGB(0.6, 0.6, 0.6, THREE.SRGBColorSpace);
      else colourAt(stops, span > 0 ? (v - q.range[0]) / span : 0.5, c);
      c.toArray(colours, 3 * i);
    }
    l.geometry.setAttribute('color', new THREE.BufferAttribute(colours, 3));
    l.painted = true;
  }

  persistenceRange() {
    const p = this.layers.filter((l) => l.kind === 'sheet' && Number.isFinite(l.persistence)).map((l) => l.persistence);
    return p.length ? [Math.min(...p), Math.max(...p)] : [0, 1];
  }

  drawBars() {
    this.bars.replaceChildren();
    const bar = (title, unit, range, scale) => {
      const stops = this.settings.scales[scale].map((s) => `rgb(${s.join(',')})`).join(',');
      const middle = 0.5 * (range[0] + range[1]);
      this.bars.append(element('div', { className: 'bar' },
        element('div', { className: 'bar-title' }, `${say(title)}${unit ? ` [${unit}]` : ''}`),
        element('div', { className: 'bar-colours', style: `background:linear-gradient(to right,${stops})` }),
        element('div', { className: 'bar-ticks' }, element('span', {}, number(range[0])),
          element('span', {}, number(middle)), element('span', {}, number(range[1])))));
    };
    const seen = new Set();
    for (const l of this.layers) {
      if (!l.object.visible || !l.quantity) continue;
      const q = l.quantity;
      const on = (l.kind === 'sheet' && this.sheetColours === 'radius')
        || (l.kind === 'surface' && this.surfaceColours === q.name);
      const key = `${q.name}|${q.range}|${q.scale}`;
      if (on && !seen.has(key)) { seen.add(key); bar(q.name, q.unit, q.range, q.scale); }
    }
    if (this.sheetColours === 'persistence' && this.layers.some((l) => l.kind === 'sheet' && l.object.visible)) {
      bar('persistence', 'mm', this.persistenceRange(), 'viridis');
    }
  }

  // --- panel -------------------------------------------------------------------------------------------------------

  buildPanel() {
    const p = this.panel;
    p.replaceChildren();
    const shapes = [...new Set(this.layers.map((l) => l.shape))];
    const layerRows = [];
    for (const shape of shapes) {
      if (shapes.length > 1 && shape) layerRows.push(element('h4', {}, SHAPES[shape] ?? shape));
      for (const [kind, word] of KINDS) {
        const of = this.layers.filter((l) => l.kind === kind && l.shape === shape);
        if (!of.length) continue;
        const key = `${kind}|${shape}`;
        const swatch = kind === 'sheet' ? 'linear-gradient(90deg,#e09f3e 33%,#3a86c8 33% 66%,#5ba85f 66%)'
          : `#${of[0].colour.getHexString()}`;
        const { row, input } = checkbox(word, this.shown.get(key), swatch, of.length > 1 || ELEMENTS.has(kind) ? of.length : undefined,
          (on) => { this.shown.set(key, on); this.apply(); });
        input.dataset.layer = key;
        layerRows.push(row);
      }
    }
    p.append(section('Layers', ...layerRows));
    if (shapes.includes('baseline') && shapes.includes('followup')) p.append(this.datesSection());
    p.append(this.lookSection());
    const graded = this.layers.filter((l) => Number.isFinite(l.persistence));
    if (graded.length) p.append(this.toleranceSection(graded));
    if (this.settings.T_target_source) p.append(this.motionSection());
    p.append(this.clipSection());
    p.append(this.viewSection());
    p.append(element('div', { className: 'hint' }, 'Click the picture: what is there is named in its corner.'));
    this.info?.remove();
    this.info = element('div', { className: 'info picked', role: 'status' });
    this.host.append(this.info);
  }

  // Before, after, or the follow-up as glass over the baseline.
  datesSection() {
    const show = (which) => {
      this.ghost = which === 'both' ? 'followup' : '';
      for (const shape of ['baseline', 'followup']) {
        const on = which === 'both' || which === shape;
        const key = `surface|${shape}`;
        if (!this.shown.has(key)) continue;
        this.shown.set(key, on);
        const box = this.panel.querySelector(`input[data-layer="${key}"]`);
        if (box) box.checked = on;
      }
      this.apply();
    };
    return section('Dates', segmented([['baseline', 'before'], ['both', 'both'], ['followup', 'after']], 'baseline', show).row);
  }

  lookSection() {
    const rows = [];
    if (this.layers.some((l) => l.kind === 'sheet')) {
      rows.push(select('Sheets by', [['component', 'component'], ['radius', 'radius'], ['persistence', 'persistence']],
        this.sheetColours, (v) => { this.sheetColours = v; this.apply(); }).row);
    }
    const names = [...new Set(this.layers.filter((l) => l.kind === 'surface' && l.quantity).map((l) => l.quantity.name))];
    const clarity = slider('Surface opacity', 0, 1, 0.01, this.clarity, (v) => `${Math.round(100 * v)} %`,
      (v) => { this.clarity = v; this.apply(); });
    this.claritySlider = clarity;
    if (names.length) {
      rows.push(select('Surface by', [['', 'plain'], ...names.map((n) => [n, n])], this.surfaceColours ?? '', (v) => {
        this.surfaceColours = v;
        // A colour map on glass cannot be read.
        if (v && this.clarity < 0.85) { this.clarity = 1; clarity.set(1); }
        this.apply();
      }).row);
    }
    if (this.layers.some((l) => l.kind === 'surface')) rows.push(clarity.row);
    return section('Look', ...rows);
  }

  toleranceSection(graded) {
    const top = Math.max(...graded.map((l) => l.persistence));
    const low = Math.min(this.tolerance, top);
    const note = element('div', { className: 'hint' });
    const tell = () => {
      const count = (kind) => {
        const of = graded.filter((l) => l.kind === kind);
        return of.length ? `${of.filter((l) => l.persistence >= this.tolerance - 1e-12).length} of ${of.length} ${kind === 'axial' ? 'axial curves' : `${kind}s`}` : '';
      };
      // Sheets become one where the curve between them goes, so the graph has fewer than the picture shows.
      const level = (this.settings.levels ?? []).find((l) => l.tolerance_mm >= this.tolerance - 1e-12);
      const graph = level ? `; as a graph ${level.sheets} sheets, ${level.axial_curves} axial curves` : '';
      note.textContent = ['sheet', 'axial'].map(count).filter(Boolean).join(', ') + graph;
    };
    const s = slider('Hide below persistence', low, top, (top - low) / 400 || 1e-6, this.tolerance,
      (v) => `${number(v)} mm`, (v) => { this.tolerance = v; tell(); this.apply(); });
    this.toleranceSlider = s;
    tell();
    return section('Tolerance', s.row, note);
  }

  motionSection() {
    return section('Source', segmented([['aligned', 'aligned'], ['given', 'as given']], 'aligned',
      (v) => this.setMotion(v === 'given')).row,
    element('div', { className: 'hint' }, 'As given shows the source before T_target_source.'));
  }

  // Source layers are stored aligned; "as given" undoes T_target_source, in coordinates about the centre.
  setMotion(given) {
    const rows = this.settings.T_target_source.flat();
    const undo = new THREE.Matrix4().set(...rows).invert();
    const c = this.centre;
    const there = new THREE.Matrix4().makeTranslation(c.x, c.y, c.z);
    const back = new THREE.Matrix4().makeTranslation(-c.x, -c.y, -c.z);
    const matrix = given ? back.multiply(undo).multiply(there) : new THREE.Matrix4();
    for (const l of this.layers) {
      if (l.shape === 'source') {
        l.object.matrixAutoUpdate = false;
        l.object.matrix.copy(matrix);
        l.object.updateMatrixWorld(true);
      }
      if (l.kind === 'correspondence') l.object.visible = !given && this.shown.get('correspondence|');
    }
    this.given = given;
    this.home();
  }

  clipSection() {
    const at = slider('Position', 0, 1, 0.002, this.clipAt, (v) => `${Math.round(100 * v)} %`,
      (v) => { this.clipAt = v; this.placeClip(); this.draw(); });
    const axes = [['off', 'off'], ['x', 'right-left'], ['y', 'front-back'], ['z', 'foot-head'], ['view', 'view']];
    return section('Clip plane',
      select('Axis', axes, 'off', (v) => {
        this.clipAxis = v;
        if (v === 'view') this.clipNormal = this.camera.getWorldDirection(new THREE.Vector3());
        this.apply();
      }).row,
      at.row,
      checkbox('Other side', false, null, undefined, (on) => { this.clipFlip = on; this.placeClip(); this.draw(); }).row);
  }

  placeClip() {
    if (this.clipAxis === 'off' || !this.box) return;
    const n = { x: new THREE.Vector3(-1, 0, 0), y: new THREE.Vector3(0, 1, 0), z: new THREE.Vector3(0, 0, -1),
      view: this.clipNormal }[this.clipAxis].clone();
    const centre = this.box.getCenter(new THREE.Vector3());
    const half = this.box.getSize(new THREE.Vector3()).multiplyScalar(0.5);
    const reach = this.clipAxis === 'view' ? this.radius : Math.abs(n.dot(half));
    if (this.clipFlip) n.negate();
    const along = (2 * this.clipAt - 1) * reach * 1.001 * (this.clipFlip ? -1 : 1);
    this.clip.setFromNormalAndCoplanarPoint(n, centre.addScaledVector(n, this.clipFlip ? -along : along));
  }

  viewSection() {
    const looks = { R: [-1, 0, 0], L: [1, 0, 0], A: [0, -1, 0], P: [0, 1, 0], S: [0, 0, 1], I: [0, 0, -1] };
    const names = { R: 'right', L: 'left', A: 'front', P: 'back', S: 'above', I: 'below' };
    const buttons = element('div', { className: 'buttons' });
    for (const [key, d] of Object.entries(looks)) {
      buttons.append(element('button', { type: 'button', title: `from ${names[key]}`, onclick: () =>
        this.look(new THREE.Vector3(...d), Math.abs(d[2]) ? new THREE.Vector3(0, -1, 0) : new THREE.Vector3(0, 0, 1)) }, key));
    }
    const more = element('div', { className: 'buttons' },
      element('button', { type: 'button', onclick: () => this.home() }, 'Reset'),
      element('button', { type: 'button', onclick: () => this.setBackground(this.background === 'light' ? 'dark' : 'light') }, 'Background'),
      element('button', { type: 'button', onclick: () => this.save() }, 'Save picture'));
    return section('View', buttons, more);
  }

  setBackground(which) {
    this.background = which;
    this.host.dataset.background = which;
    this.renderer.setClearColor(which === 'light' ? 0xf6f8fa : 0x14181d);
    this.draw();
  }

  save() {
    this.render();
    this.renderer.domElement.toBlob((blob) => {
      const link = element('a', { href: URL.createObjectURL(blob), download: 'view.png' });
      link.click();
      URL.revokeObjectURL(link.href);
    });
  }

  // --- camera ------------------------------------------------------------------------------------------------------

  home() {
    const v = this.settings.view ?? { toward_camera: [0, -1, 0], up: [0, 0, 1] };
    this.look(new THREE.Vector3(...v.toward_camera), new THREE.Vector3(...v.up));
  }

  look(toward, up) {
    const seen = new THREE.Box3();
    for (const l of this.layers) if (l.object.visible) seen.expandByObject(l.object);
    if (seen.isEmpty()) seen.copy(this.box);
    // Both dates fit in the picture, whichever is shown, so that turning from one to the other moves nothing.
    const framed = this.layers.filter((x) => x.object.visible || x.shape === 'followup');
    const box = seen.clone();
    for (const l of framed) box.expandByObject(l.object);
    const centre = box.getCenter(new THREE.Vector3());
    const aspect = this.camera.aspect || 1;
    const half = Math.tan(THREE.MathUtils.degToRad(0.5 * this.camera.fov));
    // The distance at which every point (some of a large scene) is inside the picture, with a margin.
    const right = new THREE.Vector3().crossVectors(up, toward).normalize();
    const realUp = new THREE.Vector3().crossVectors(toward, right).normalize();
    const p = new THREE.Vector3();
    let distance = 0;
    for (const l of framed) {
      const position = l.geometry.getAttribute('position');
      const stride = Math.max(1, Math.floor(position.count / 5000));
      for (let i = 0; i < position.count; i += stride) {
        p.fromBufferAttribute(position, i).applyMatrix4(l.object.matrix).sub(centre);
        const depth = p.dot(toward);
        distance = Math.max(distance, depth + Math.abs(p.dot(right)) / (half * aspect), depth + Math.abs(p.dot(realUp)) / half);
      }
    }
    distance = distance || 1;
    distance *= 1.1;
    this.camera.up.copy(up);
    this.controls.dispose();
    this.camera.position.copy(centre).addScaledVector(toward, distance);
    this.camera.near = Math.max(distance - 3 * this.radius, 0.002 * this.radius);
    this.camera.far = distance + 12 * this.radius;
    this.camera.updateProjectionMatrix();
    // OrbitControls reads `up` once, when it is made.
    this.controls = new OrbitControls(this.camera, this.renderer.domElement);
    this.controls.target.copy(centre);
    this.controls.zoomSpeed = 0.8;
    this.controls.addEventListener('change', () => this.draw());
    this.controls.update();
    const s = seen.getSize(new THREE.Vector3());
    this.size.textContent = `${number(s.x)} × ${number(s.y)} × ${number(s.z)} mm (right-left × front-back × foot-head)`;
    this.draw();
  }

  resize() {
    const { clientWidth: w, clientHeight: h } = this.host;
    if (!w || !h) return;
    const size = this.renderer.getSize(new THREE.Vector2());
    if (size.x === w && size.y === h) return;
    this.renderer.setSize(w, h, false);
    const framed = this.camera.aspect;
    this.camera.aspect = w / h;
    this.camera.updateProjectionMatrix();
    if (this.layers.length && Math.abs(framed - w / h) > 0.2) this.home();
    // A canvas of a new size is empty: drawn at once, or it would flicker, and stay empty in a screenshot.
    this.render();
  }

  draw() {
    if (this.waiting) return;
    this.waiting = true;
    requestAnimationFrame(() => { this.waiting = false; this.render(); });
  }

  render() {
    const distance = this.camera.position.distanceTo(this.controls?.target ?? new THREE.Vector3());
    if (this.radius) {
      this.camera.near = Math.max(distance - 4 * this.radius, 0.004 * this.radius);
      this.camera.far = distance + 12 * this.radius;
      this.camera.updateProjectionMatrix();
    }
    this.renderer.render(this.scene, this.camera);
    this.drawTriad();
  }

  drawTriad() {
    const g = this.triad.getContext('2d');
    g.clearRect(0, 0, 176, 176);
    const inverse = this.camera.quaternion.clone().invert();
    const axes = [[[1, 0, 0], 'L', 'R', '#b23b3b'], [[0, 1, 0], 'P', 'A', '#3b8f4a'], [[0, 0, 1], 'S', 'I', '#3b62b2']];
    const arms = axes.flatMap(([d, plus, minus, colour]) => {
      const v = new THREE.Vector3(...d).applyQuaternion(inverse);
      return [[v, plus, colour, 1], [v.clone().negate(), minus, colour, 0.45]];
    }).sort((a, b) => a[0].z - b[0].z);
    g.font = '600 20px system-ui, sans-serif';
    g.textAlign = 'center';
    g.textBaseline = 'middle';
    for (const [v, text, colour, alpha] of arms) {
      g.globalAlpha = alpha * (0.65 + 0.35 * v.z);
      g.strokeStyle = g.fillStyle = colour;
      g.lineWidth = 3;
      g.beginPath();
      g.moveTo(88, 88);
      g.lineTo(88 + 54 * v.x, 88 - 54 * v.y);
      g.stroke();
      g.fillText(text, 88 + 70 * v.x, 88 - 70 * v.y);
    }
    g.globalAlpha = 1;
  }

  // --- picking -----------------------------------------------------------------------------------------------------

  listenForPicks() {
    const canvas = this.renderer.domElement;
    let down = null;
    canvas.addEventListener('pointerdown', (e) => { down = [e.clientX, e.clientY]; });
    canvas.addEventListener('pointerup', (e) => {
      if (down && Math.hypot(e.clientX - down[0], e.clientY - down[1]) < 4) {
        const box = canvas.getBoundingClientRect();
        this.pick((e.clientX - box.left) / box.width, (e.clientY - box.top) / box.height);
      }
      down = null;
    });
  }

  // `x`, `y` from 0 to 1, from the top left. What is inside wins over a translucent surface in front of it.
  pick(x, y) {
    const ray = new THREE.Raycaster();
    ray.setFromCamera(new THREE.Vector2(2 * x - 1, 1 - 2 * y), this.camera);
    const meshes = this.layers.filter((l) => l.object.visible).map((l) => l.meshes[0]);
    for (const m of meshes) m.material.side = m.userData.layer.kind === 'surface' ? THREE.DoubleSide : m.material.side;
    const hits = ray.intersectObjects(meshes, false)
      .filter((h) => this.clipAxis === 'off' || this.clip.distanceToPoint(h.point) >= 0);
    for (const m of meshes) if (m.userData.layer.kind === 'surface') m.material.side = THREE.FrontSide;
    const inner = this.clarity < 0.9 ? hits.find((h) => h.object.userData.layer.kind !== 'surface') : null;
    const hit = inner ?? hits[0];
    this.select(hit ? hit.object.userData.layer : null);
    if (!hit) {
      this.info.replaceChildren();
      this.picked = null;
      return null;
    }
    const layer = hit.object.userData.layer;
    const given = this.given && layer.shape === 'source';
    const at = given ? hit.point.clone().applyMatrix4(layer.object.matrix.clone().invert()) : hit.point.clone();
    at.add(this.centre);
    const rows = [];
    if (layer.quantity) {
      const a = hit.object.geometry.getAttribute(layer.quantity.attribute.toLowerCase());
      const f = hit.face;
      const b = THREE.Triangle.getBarycoord(
        hit.object.worldToLocal(hit.point.clone()),
        ...[f.a, f.b, f.c].map((i) => new THREE.Vector3().fromBufferAttribute(hit.object.geometry.getAttribute('position'), i)),
        new THREE.Vector3());
      const value = b ? a.getX(f.a) * b.x + a.getX(f.b) * b.y + a.getX(f.c) * b.z : a.getX(f.a);
      rows.push([`${layer.quantity.name} here`, `${number(value)} ${layer.quantity.unit}`]);
    }
    const units = { mm: 'mm', mm2: 'mm²', mm3: 'mm³' };
    for (const [name, value] of Object.entries(layer.properties)) {
      const m = name.match(/^(.*)_(mm[23]?)$/);
      const text = typeof value === 'number' ? number(value) : String(value);
      rows.push([(m ? m[1] : name).replaceAll('_', ' '), m ? `${text} ${units[m[2]]}` : text]);
    }
    rows.push(['position', `${at.toArray().map((v) => number(+v.toFixed(2))).join(', ')} mm`]);
    const table = element('table', {});
    for (const [k, v] of rows) table.append(element('tr', {}, element('th', {}, k), element('td', {}, v)));
    this.info.replaceChildren(element('strong', {}, say(layer.label)), table);
    this.picked = { name: layer.label, kind: layer.kind, properties: layer.properties, position: at.toArray() };
    return this.picked;
  }

  select(layer) {
    if (this.selected) for (const m of this.selected.meshes) m.material.emissive.setRGB(0, 0, 0);
    this.selected = layer;
    if (layer && layer.kind !== 'surface') for (const m of layer.meshes) m.material.emissive.setRGB(0.22, 0.2, 0.08);
    this.draw();
  }
}

function bytesOf(base64) {
  const text = atob(base64);
  const bytes = new Uint8Array(text.length);
  for (let i = 0; i < text.length; i++) bytes[i] = text.charCodeAt(i);
  return bytes.buffer;
}

function start() {
  const figure = document.getElementById('viewer');
  const source = document.getElementById('scene-glb');
  if (!figure || !source) return;
  const showStill = (why) => {
    figure.dataset.state = 'still';
    document.getElementById('viewer-note').textContent = why;
  };
  const probe = document.createElement('canvas').getContext('webgl2');
  if (!probe) {
    showStill('This browser has no WebGL 2; the picture above was drawn when the report was written.');
    return;
  }
  probe.getExtension('WEBGL_lose_context')?.loseContext();
  const settings = JSON.parse(document.getElementById('view-settings').textContent);
  const viewer = new Viewer(document.getElementById('stage'), document.getElementById('panel'), settings);
  new GLTFLoader().parse(bytesOf(source.textContent.trim()), '', (gltf) => {
    figure.dataset.state = 'live';
    viewer.resize();
    viewer.load(gltf);
    viewer.render();
    figure.dataset.layers = String(viewer.layers.length);
    window.medialViewer = viewer;
  }, (error) => {
    showStill('The 3D scene could not be read; the picture above was drawn when the report was written.');
    throw error;
  });
}

start();
