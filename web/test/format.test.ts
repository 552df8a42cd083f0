import { describe, expect, it } from 'vitest';
import { clockOffset, compact, count, duration, fixed, latency, length, plural, UNKNOWN } from '../src/format';

describe('fixed', () => {
  it('writes a real minus sign and all digits', () => expect(fixed(-1.5, 3)).toBe('−1.500'));
  it('has no negative zero', () => expect(fixed(-0.0004, 3)).toBe('0.000'));
  it('keeps the sign of what is left after rounding', () => expect(fixed(-0.0006, 3)).toBe('−0.001'));
  it.each([null, NaN, Infinity])('does not know %s', (value) => expect(fixed(value, 3)).toBe(UNKNOWN));
});

describe('compact', () => {
  it('loses decimals as the number grows', () => {
    expect([2.134, 21.34, 213.4].map((value) => compact(value, 2))).toEqual(['2.13', '21.3', '213']);
  });
});

describe('clockOffset', () => {
  it.each([
    [0, '0', 'µs'], [-12e-6, '−12', 'µs'], [0.0003121, '0.31', 'ms'], [-0.0234, '−23', 'ms'], [108_000, '30.0', 'h'],
  ])('writes %s s as %s %s', (seconds, value, unit) => expect(clockOffset(seconds)).toEqual({ value, unit }));
});

describe('duration', () => {
  it.each([
    [23.4, '23', 'ms'], [999.4, '999', 'ms'], [999.6, '1.0', 's'], [1400, '1.4', 's'], [59_000, '59', 's'],
    [180_000, '3', 'min'], [7_200_000, '2.0', 'h'],
  ])('%d ms is %s %s', (ms, value, unit) => expect(duration(ms)).toEqual({ value, unit }));
  it('does not know null', () => expect(duration(null).value).toBe(UNKNOWN));
});

describe('latency', () => {
  it.each([[7.44, '7.4', 'ms'], [23.4, '23', 'ms'], [1458, '1.5', 's']])('%d ms is %s %s', (ms, value, unit) =>
    expect(latency(ms)).toEqual({ value, unit }),
  );
});

describe('length', () => {
  it('changes to metres where millimetres become long', () => {
    expect(length(2.13)).toEqual({ value: '2.1', unit: 'mm' });
    expect(length(48.2)).toEqual({ value: '48', unit: 'mm' });
    expect(length(1250)).toEqual({ value: '1.25', unit: 'm' });
  });
});

describe('count and plural', () => {
  it('shortens large counts', () => {
    expect([812, 12_400, 512_000, 3_100_000].map(count)).toEqual(['812', '12.4 k', '512 k', '3.1 M']);
  });
  it('counts one in the singular', () => {
    expect(plural(1, 'tag', 'tags')).toBe('1 tag');
    expect(plural(0, 'tag', 'tags')).toBe('0 tags');
  });
});
