// Programs and textures of WebGL2, with errors in words.

/** Compiles and links two shaders; `uniforms` of the result are the places of all uniforms by name. */
export function makeProgram(gl, vertex, fragment) {
  const program = gl.createProgram();
  for (const [kind, source] of [[gl.VERTEX_SHADER, vertex], [gl.FRAGMENT_SHADER, fragment]]) {
    const shader = gl.createShader(kind);
    gl.shaderSource(shader, source);
    gl.compileShader(shader);
    gl.attachShader(program, shader);
  }
  gl.linkProgram(program);
  if (!gl.getProgramParameter(program, gl.LINK_STATUS) && !gl.isContextLost()) {
    const logs = gl.getAttachedShaders(program).map((shader) => gl.getShaderInfoLog(shader));
    throw new Error(`The graphics driver refuses a shader: ${logs.join(" ")} ${gl.getProgramInfoLog(program)}`);
  }
  const uniforms = {};
  const count = gl.getProgramParameter(program, gl.ACTIVE_UNIFORMS) ?? 0;
  for (let i = 0; i < count; i++) {
    const { name } = gl.getActiveUniform(program, i);
    uniforms[name] = gl.getUniformLocation(program, name);
  }
  return { program, uniforms };
}

/**
 * A texture that shaders fetch single texels of.
 *
 * @param {number[]} format internal format, format and type.
 * @param {number[]} size width, height, and layers of an array of textures.
 * @param {ArrayBufferView|null} data null leaves it empty.
 * @param {number} filter of shaders that do not fetch single ones.
 */
export function makeTexture(gl, format, size, data, filter = gl.NEAREST) {
  const [internal, channels, type] = format;
  const target = size.length === 3 ? gl.TEXTURE_2D_ARRAY : gl.TEXTURE_2D;
  const most = gl.getParameter(gl.MAX_TEXTURE_SIZE);
  if (Math.max(...size.slice(0, 2)) > most) {
    throw new Error(`This scene needs textures of ${size[1]} rows; the graphics driver has at most ${most}.`);
  }
  const texture = gl.createTexture();
  gl.bindTexture(target, texture);
  gl.pixelStorei(gl.UNPACK_ALIGNMENT, 1);
  const upload = size.length === 3 ? gl.texImage3D : gl.texImage2D;
  upload.call(gl, target, 0, internal, ...size, 0, channels, type, data);
  for (const side of [gl.TEXTURE_MIN_FILTER, gl.TEXTURE_MAG_FILTER]) gl.texParameteri(target, side, filter);
  return { texture, target };
}
