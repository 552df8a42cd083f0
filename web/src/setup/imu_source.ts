// The configuration of the source of the IMU's samples.
import { typedNumber } from './words';

export interface ImuField {
  key: string;
  words: string;
  usual: string;
  /** Only whole numbers are one. */
  isNumber?: boolean;
}

export interface ImuType {
  words: string;
  explained: string;
  fields: ImuField[];
  /** Its axes may be others than the robot's. */
  hasAxes: boolean;
}

export const IMU_TYPES: Record<string, ImuType> = {
  line: {
    words: 'Microcontroller (serial line)',
    explained: 'A line of text for each sample, by USB or a serial port.',
    fields: [
      { key: 'device', words: 'Device', usual: '/dev/ttyACM0' },
      { key: 'baud', words: 'Baud', usual: '115200', isNumber: true },
    ],
    hasAxes: true,
  },
  mavlink: {
    words: 'Autopilot (MAVLink)',
    explained: 'PX4 or ArduPilot sends MAVLink to this computer by UDP.',
    fields: [{ key: 'port', words: 'UDP port', usual: '14550', isNumber: true }],
    hasAxes: false,
  },
  iio: {
    words: 'Chip on this computer (Linux IIO)',
    explained: 'A driver of the kernel reads it; no settings are needed.',
    fields: [],
    hasAxes: true,
  },
  px4: {
    words: 'PX4 by ROS 2 (uXRCE-DDS)',
    explained: 'The topic SensorCombined of a PX4 autopilot.',
    fields: [],
    hasAxes: false,
  },
  ros: {
    words: 'ROS 2 topic',
    explained: 'Messages sensor_msgs/Imu.',
    fields: [{ key: 'topic', words: 'Topic', usual: '/imu/data' }],
    hasAxes: true,
  },
};

/** Of a newer server: only its name is known. */
export function imuType(name: string): ImuType {
  return IMU_TYPES[name] ?? { words: name, explained: '', fields: [], hasAxes: true };
}

/** A text as YAML, quoted where needed. */
export function yamlText(text: string): string {
  const isPlain = /^[A-Za-z0-9/._][A-Za-z0-9/._@%+-]*$/.test(text);
  return isPlain && Number.isNaN(Number(text)) ? text : JSON.stringify(text);
}

/** The section as YAML. @param axes  empty: as the robot's. Throws a message. */
export function imuSource(name: string, typed: Record<string, string>, axes: string): string {
  const type = imuType(name);
  const lines = [`type: ${name}`];
  for (const { key, words, isNumber } of type.fields) {
    const value = (typed[key] ?? '').trim();
    if (value === '') throw new Error(`${words}: write one.`);
    const number = isNumber ? typedNumber(value) : 0;
    if (number === null || !Number.isInteger(number) || number < 0)
      throw new Error(`${words}: “${value}” is no whole number.`);
    lines.push(`${key}: ${isNumber ? String(number) : yamlText(value)}`);
  }
  if (type.hasAxes && axes !== '') lines.push(`axes: ${axes}`);
  return lines.join('\n');
}
