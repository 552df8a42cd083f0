import { defineConfig } from 'vite';

// plots.js: one classic script with uPlot inside, which `fiducap` writes into its HTML reports.
export default defineConfig({
  build: {
    target: 'es2020',
    outDir: process.env.FIDUCAP_WEB_OUT ?? 'dist',
    emptyOutDir: false, // beside the page
    copyPublicDir: false,
    lib: { entry: 'src/plots.ts', formats: ['iife'], name: 'fiducapPlots', fileName: () => 'plots.js' },
  },
});
