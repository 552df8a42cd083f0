// Speaks the IMU line protocol of Fiducap (docs/imu-line-protocol.md) with an MPU-6050 or MPU-6500 at
// I2C address 0x68, on any Arduino or ESP32 board. For another unit replace begin_imu and read_imu.
#include <Wire.h>

const uint32_t kBaud = 921600;      // an Uno does 115200 or 1000000; then also lower the rate
const uint32_t kPeriod_us = 5000;   // 200 readings a second
const uint8_t kUnit = 0x68;
const float kRadPerCount = 1000.0f / 32768.0f * 0.01745329252f;  // range ±1000 °/s
const float kMetrePerCount = 8.0f / 32768.0f * 9.80665f;         // range ±8 g

void write_register(uint8_t address, uint8_t value) {
  Wire.beginTransmission(kUnit);
  Wire.write(address);
  Wire.write(value);
  Wire.endTransmission();
}

void begin_imu() {
  Wire.begin();
  Wire.setClock(400000);
  write_register(0x6B, 0x01);  // awake, clock of the gyro
  write_register(0x1A, 0x02);  // low pass of 98 Hz
  write_register(0x1B, 0x10);  // gyro ±1000 °/s
  write_register(0x1C, 0x10);  // accelerometer ±8 g
}

// Specific force and rate, in the axes that are printed on the board. False: the unit is silent.
bool read_imu(float w[3], float f[3]) {
  Wire.beginTransmission(kUnit);
  Wire.write(0x3B);
  if (Wire.endTransmission(false) != 0) return false;
  if (Wire.requestFrom(kUnit, (uint8_t)14) != 14) return false;
  int16_t raw[7];
  for (int i = 0; i < 7; ++i) {
    const uint8_t high = Wire.read();
    raw[i] = (int16_t)((high << 8) | Wire.read());
  }
  for (int i = 0; i < 3; ++i) {
    f[i] = raw[i] * kMetrePerCount;
    w[i] = raw[4 + i] * kRadPerCount;  // raw[3] is the temperature
  }
  return true;
}

char line[160];
int length = 0;

void append(const char* text) {
  while (*text != 0 && length < (int)sizeof line - 1) line[length++] = *text++;
}

void append(float value, int decimals) {
  char text[20];
  dtostrf(value, 1, decimals, text);
  append(",");
  append(text);
}

// The checksum, the end, and out.
void send_line() {
  uint8_t sum = 0;
  for (int i = 0; i < length; ++i) sum ^= (uint8_t)line[i];
  const char* digits = "0123456789ABCDEF";
  const char end[] = {'*', digits[sum >> 4], digits[sum & 15], '\n', 0};
  append(end);
  Serial.write((const uint8_t*)line, length);
  length = 0;
}

uint32_t next_us;

void setup() {
  Serial.begin(kBaud);
  begin_imu();
  Serial.println("# IMU line protocol, MPU-6050");
  next_us = micros();
}

void loop() {
  if ((int32_t)(micros() - next_us) < 0) return;
  next_us += kPeriod_us;
  const uint32_t now_us = micros();  // when the unit is read
  float w[3], f[3];
  if (!read_imu(w, f)) {
    Serial.println("# the unit does not answer: look at its wires and its address");
    delay(500);
    next_us = micros();
    return;
  }
  char text[16];
  ultoa(now_us, text, 10);
  append("IMU,");
  append(text);
  for (int i = 0; i < 3; ++i) append(w[i], 5);
  for (int i = 0; i < 3; ++i) append(f[i], 4);
  send_line();
}
