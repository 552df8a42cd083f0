#pragma once

#include <cstddef>
#include <optional>
#include <span>
#include <string>
#include <vector>

#include "streaming/natnet/codec.hpp"

/// Decodes messages of any NatNet server field by field.
namespace fiducap::natnet {

struct WireField {
  std::string name;  ///< E.g. `body.mean_error`
  double value{};    ///< Of a text its length.
};

struct WireFrame {
  std::vector<WireField> fields;
  std::vector<std::vector<WireField>> bodies;

  /// The first of this name.
  [[nodiscard]] std::optional<double> operator[](const std::string& name) const;
  /// The names in their order, each once: what a client of this version reads.
  [[nodiscard]] std::vector<std::string> structure() const;
};

/// @return nothing when it does not end where its last field does
[[nodiscard]] std::optional<WireFrame> take_apart(std::span<const std::byte> frame,
                                                  Bitstream version);

/// UDP payloads of a pcapng file (Ethernet, IPv4), in order.
struct CapturedDatagram {
  std::vector<std::byte> bytes;
  std::uint16_t from_port{};
  std::uint16_t to_port{};
};
[[nodiscard]] std::vector<CapturedDatagram> read_capture(const std::string& file);
[[nodiscard]] std::vector<std::byte> read_bytes(const std::string& file);

}  // namespace fiducap::natnet
