// A ZIP archive: its directory, and what is in it.
#include "capture/import/input_file.hpp"
#include "fuzz/memory_file.hpp"

extern "C" int LLVMFuzzerTestOneInput(const std::uint8_t* data, std::size_t size) {
  using namespace fiducap;
  static const fuzz::MemoryFile file;
  static const fuzz::MemoryFile out;
  file.put(std::as_bytes(std::span(data, size)));
  auto archive = ZipArchive::open(file.path());
  if (!archive) return 0;
  constexpr std::size_t kTried = 4;
  for (std::size_t i = 0; i < std::min(kTried, archive->entries().size()); ++i) {
    const ZipEntry& entry = archive->entries()[i];
    const bool unpacked = archive->unpack(entry, out.path()).has_value();
    std::error_code error;
    if (unpacked) fuzz::require(std::filesystem::file_size(out.path(), error) == entry.bytes);
  }
  return 0;
}
