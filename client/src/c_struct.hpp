#pragma once

#include <algorithm>
#include <cstddef>
#include <cstdint>
#include <cstring>
#include <string>

namespace fiducap::sdk {

/// Copies what the caller's version of the struct has room for; `struct_size` stays the caller's.
/// @return false for a struct that does not say its size
template <typename Struct>
bool give(Struct from, Struct* to) {
  if (to == nullptr || to->struct_size < sizeof(std::uint32_t)) return false;
  from.struct_size = to->struct_size;
  std::memcpy(to, &from, std::min<std::size_t>(to->struct_size, sizeof(Struct)));
  return true;
}

/// The caller's struct, completed by zeros to our version of it.
template <typename Struct>
Struct take(const Struct* from) {
  Struct taken{};
  if (from != nullptr)
    std::memcpy(&taken, from, std::min<std::size_t>(from->struct_size, sizeof(Struct)));
  return taken;
}

/// As much of the text as fits, with a closing zero, never half a character.
inline void give_text(const std::string& text, char* to, std::size_t room) {
  if (to == nullptr || room == 0) return;
  std::size_t size = std::min(text.size(), room - 1);
  while (size < text.size() && size > 0 && (static_cast<unsigned char>(text[size]) & 0xc0) == 0x80)
    --size;
  std::memcpy(to, text.data(), size);
  to[size] = '\0';
}

inline std::string text_or(const char* text, const char* otherwise) {
  return text != nullptr ? text : otherwise;
}

}  // namespace fiducap::sdk
