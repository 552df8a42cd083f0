import { defineConfig } from 'vite';

// The server of the page is `fiducapd`; `npm run dev` serves the sources and asks a running one for the data.
const server = process.env.FIDUCAP_SERVER ?? 'http://127.0.0.1:8080';

export default defineConfig({
  base: './',
  // By number: a bare container may not know the name localhost.
  server: { host: '127.0.0.1', proxy: { '/api': { target: server, ws: true } } },
  build: {
    target: 'es2020',
    outDir: process.env.FIDUCAP_WEB_OUT ?? 'dist',
    emptyOutDir: true,
    assetsInlineLimit: 0, // the content security policy of the page allows no inlined code
    modulePreload: { polyfill: false },
    chunkSizeWarningLimit: 1000,
  },
  // One process for all: the tests share no state, and starting one for each file takes longer than running them.
  test: { include: ['test/**/*.test.ts'], isolate: false },
});
