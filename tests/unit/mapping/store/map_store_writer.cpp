// Commits versions, every third one a roll-back, until it is killed and says after each one that it
// is stored: the victim of map_store_kill_test.
#include <unistd.h>

#include <cstdio>
#include <string>

#include "mapping/store/map_store.hpp"
#include "unit/mapping/map_fixture.hpp"

int main(int argc, char** argv) {
  using namespace fiducap;
  if (argc != 2) return 2;
  auto store = MapStore::open(argv[1]);
  if (!store) {
    std::fprintf(stderr, "%s\n", store.error().text().c_str());
    return 1;
  }
  auto map = store->newest();
  if (!map) return 1;
  std::vector<int> ids;
  for (int id = 0; id < 40; ++id) ids.push_back(id);
  if (map->tags.empty()) *map = make_map(ids);
  for (;;) {
    const bool goes_back = map->version > 2 && map->version % 3 == 0;
    if (goes_back) {
      map = store->load(map->version - 2);
      if (!map) return 1;
    } else {
      for (MapTag& entry : map->tags) entry.tag.X_WT.p.x() += 0.001;
    }
    map = store->commit(*map, goes_back ? "rolled back" : "while being killed");
    if (!map || !store->save_extrinsics({"robot", static_cast<int>(map->version % 4), Pose{}}))
      return 1;
    const std::string line = std::to_string(map->version) + " " + map->hash + "\n";
    if (write(STDOUT_FILENO, line.data(), line.size()) < 0) return 1;
  }
}
