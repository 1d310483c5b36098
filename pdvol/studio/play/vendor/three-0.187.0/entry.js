export {
  BufferAttribute, BufferGeometry, Color, DoubleSide, FrontSide, GLSL3, LineSegments, Matrix3, Mesh, OrthographicCamera,
  PerspectiveCamera, PlaneGeometry, RepeatWrapping, Scene, ShaderMaterial, ShapeUtils, Texture, Vector2, Vector3, WebGLRenderer,
  REVISION,
} from "three";
export { OrbitControls } from "three/examples/jsm/controls/OrbitControls.js";
