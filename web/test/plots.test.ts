import { expect, test } from 'vitest';
import { equalRanges } from '../src/plots';

test('a unit has the same length on both axes, and both intervals stay inside', () => {
  const [x, y] = equalRanges([-3, 5], [0, 1], 800, 200);
  expect((x[1] - x[0]) / 800).toBeCloseTo((y[1] - y[0]) / 200);
  expect(x[0]).toBeLessThan(-3);
  expect(x[1]).toBeGreaterThan(5);
  expect((y[0] + y[1]) / 2).toBeCloseTo(0.5);
});
