// A map store as a disk or a stranger left it. Opening may refuse, never crash or hang; what loads
// is a sound map.
#include "fuzz/memory_file.hpp"
#include "mapping/store/map_store.hpp"
#include "support/temporary_folder.hpp"

namespace {

using namespace fiducap;

void look_into(MapStore& store) {
  if (const auto newest = store.newest()) fuzz::require(!fault_in(*newest));
  const auto log = store.log();
  if (log && !log->empty()) (void)store.load(log->back().version);
  (void)store.extrinsics();
}

}  // namespace

extern "C" int LLVMFuzzerTestOneInput(const std::uint8_t* data, std::size_t size) {
  static const TemporaryFolder folder;
  static const std::string path = folder.file("map.sqlite");
  for (const char* end : {"-wal", "-shm", "-journal"}) ::unlink((path + end).c_str());
  folder.write("map.sqlite", {reinterpret_cast<const char*>(data), size});
  if (auto store = MapStore::open(path)) look_into(*store);
  return 0;
}
