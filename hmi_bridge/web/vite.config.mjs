import {createHash} from 'node:crypto';
import {fileURLToPath} from 'node:url';

import {defineConfig} from 'vite';

// The page's build is the digest of what it consists of: the bridge reads it from index.html and
// tells it to open pages, which load anew when it is not theirs.
function pageBuild() {
  return {
    name: 'page-build',
    transformIndexHtml: {
      order: 'post',
      handler(html, {bundle}) {
        const digest = createHash('sha256');
        for (const name of Object.keys(bundle ?? {}).sort()) {
          digest.update(name).update(bundle[name].code ?? bundle[name].source ?? '');
        }
        const build = bundle ? digest.digest('hex').slice(0, 16) : 'development';
        return html.replace('PAGE_BUILD', build);
      },
    },
  };
}

export default defineConfig({
  root: fileURLToPath(new URL('.', import.meta.url)),
  base: './',
  plugins: [pageBuild()],
  server: {
    host: '127.0.0.1',
    proxy: {'/api': {target: process.env.TBM_BRIDGE ?? 'http://127.0.0.1:8080', ws: true}},
  },
  build: {
    target: 'es2022',
    emptyOutDir: true,
    assetsInlineLimit: 0,
    modulePreload: {polyfill: false},
    reportCompressedSize: false,
  },
});
