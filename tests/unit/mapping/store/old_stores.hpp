#pragma once

#include <array>
#include <string>

#include "mapping/store/sqlite_file.hpp"

namespace fiducap {

/// A schema that servers wrote once, and what makes it out of the one after it.
struct OldSchema {
  int number{};
  const char* takes_back{};
};
/// The newest first.
inline constexpr std::array kOldSchemas{OldSchema{2, "DROP TABLE camera_lens"},
                                        OldSchema{1, "DROP TABLE tie"}};

/// A store of today becomes one that an older server has left.
inline Expected<void> make_old(const std::string& path, int schema) {
  auto file = SqliteFile::open(path);
  if (!file) return tl::unexpected(file.error());
  for (const OldSchema& old : kOldSchemas) {
    if (old.number < schema) break;
    if (auto done = file->execute(old.takes_back); !done) return done;
  }
  return file->execute(("PRAGMA user_version = " + std::to_string(schema)).c_str());
}

}  // namespace fiducap
