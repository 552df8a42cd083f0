#include "base/open_descriptors.hpp"

#include <dirent.h>

#include <charconv>
#include <memory>
#include <string_view>

namespace fiducap {

/// Not by std::filesystem: its iterators end the process when there is no memory.
std::vector<int> open_descriptors() {
  std::vector<int> all;
  const std::unique_ptr<DIR, int (*)(DIR*)> folder(::opendir("/proc/self/fd"), &::closedir);
  if (!folder) return all;
  while (const dirent* entry = ::readdir(folder.get())) {
    const std::string_view name = entry->d_name;
    int descriptor = -1;
    std::from_chars(name.data(), name.data() + name.size(), descriptor);
    if (descriptor >= 0 && descriptor != ::dirfd(folder.get())) all.push_back(descriptor);
  }
  return all;
}

}  // namespace fiducap
