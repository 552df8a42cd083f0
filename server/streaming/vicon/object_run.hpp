#pragma once

#include <algorithm>
#include <cstddef>
#include <cstdint>
#include <vector>

namespace fiducap::vicon {

/// Objects of one type, encoded one after the other, so that any selection of subjects can be copied out.
struct ObjectRun {
  struct End {
    std::uint32_t subject{};  ///< 0: of no subject.
    std::size_t at{};         ///< Behind its last byte.
  };
  std::vector<std::byte> bytes;
  std::vector<End> ends;

  void clear() {
    bytes.clear();
    ends.clear();
  }
  /// The bytes appended since the last call are one object.
  void finish(std::uint32_t subject = 0) { ends.push_back({subject, bytes.size()}); }

  /// @param wanted  ascending; null: all of them
  [[nodiscard]] static bool admits(const std::vector<std::uint32_t>* wanted, std::uint32_t subject) {
    return wanted == nullptr || std::binary_search(wanted->begin(), wanted->end(), subject);
  }
  [[nodiscard]] std::uint32_t count(const std::vector<std::uint32_t>* wanted) const {
    return static_cast<std::uint32_t>(
        std::count_if(ends.begin(), ends.end(), [&](const End& end) { return admits(wanted, end.subject); }));
  }
  void append_to(std::vector<std::byte>& out, const std::vector<std::uint32_t>* wanted) const {
    if (wanted == nullptr) {
      out.insert(out.end(), bytes.begin(), bytes.end());
      return;
    }
    std::size_t begin = 0;
    for (const End& end : ends) {
      if (admits(wanted, end.subject)) {
        out.insert(out.end(), bytes.begin() + static_cast<std::ptrdiff_t>(begin),
                   bytes.begin() + static_cast<std::ptrdiff_t>(end.at));
      }
      begin = end.at;
    }
  }
};

}  // namespace fiducap::vicon
