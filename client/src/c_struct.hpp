#pragma once

#include <algorithm>
#include <cstddef>
#include <cstdint>
#include <cstring>
#include <string>

namespace fiducap::sdk {

/// Copies the fields of the caller's version of the struct; `struct_size` stays the caller's.
/// @return false when the struct has no size
template <typename Struct>
bool give(Struct from, Struct* to) {
  if (to == nullptr || to->struct_size < sizeof(std::uint32_t)) return false;
  from.struct_size = to->struct_size;
  std::memcpy(to, &from, std::min<std::size_t>(to->struct_size, sizeof(Struct)));
  return true;
}

/// The caller's struct in our version; missing fields are zero.
template <typename Struct>
Struct take(const Struct* from) {
  Struct taken{};
  if (from != nullptr)
    std::memcpy(&taken, from, std::min<std::size_t>(from->struct_size, sizeof(Struct)));
  return taken;
}

/// Copies as much of the text as fits, with a closing zero, without cutting a character.
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
