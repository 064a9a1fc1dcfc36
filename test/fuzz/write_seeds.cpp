// What the fuzzers begin with, made of the tests' own examples: write_seeds FOLDER.
#include <filesystem>
#include <fstream>

#include "../core/journal_of_bytes.hpp"
#include "../gmrf/map_of_bytes.hpp"
#include "../node/message_of_bytes.hpp"

namespace {

// Into FOLDER/TARGET/NAME.
class Seeds {
 public:
  Seeds(const std::filesystem::path& folder, const std::string& target) : folder_(folder / target) {
    std::filesystem::create_directories(folder_);
  }
  template <typename Bytes>
  void add(const std::string& name, char first, const Bytes& bytes) const {
    std::ofstream file(folder_ / name, std::ios::binary);
    file << first;
    file.write(reinterpret_cast<const char*>(bytes.data()),
               static_cast<std::streamsize>(bytes.size()));
  }

 private:
  const std::filesystem::path folder_;
};

}  // namespace

int main(int argc, char** argv) {
  promise(argc == 2, "a folder is given");
  const Seeds messages(argv[1], "messages");
  char type = 0;
  for (const rbpf_node::WholeMessage& message : rbpf_node::wholeMessages()) {
    messages.add(std::to_string(type), type, message.raw.bytes);
    ++type;
  }
  const Seeds journals(argv[1], "journal");
  for (const int changes : {2, 10, 30, 120}) {
    for (const char right : {0, 1}) {
      journals.add(std::to_string(changes) + (right == 0 ? "" : "_right"), right,
                   rbpf_core::wholeJournal(changes));
    }
  }
  const Seeds maps(argv[1], "map");
  gmrf::Map empty(1.5, -29.0);
  gmrf::Map one_tile(1.5, -29.0);
  const gmrf::Beams beam = Eigen::Vector3d(2.0, 2.0, -30.0);
  one_tile.fold(beam, Eigen::VectorXd::Ones(1));
  gmrf::Map four_tiles = gmrf::smallMap();
  for (gmrf::Map* map : {&empty, &one_tile, &four_tiles}) {
    const std::string tiles = std::to_string(map->sums().entries().size());
    maps.add(tiles, 0, gmrf::wholeBytes(map));
    maps.add(tiles + "_right", 1, gmrf::wholeBytes(map));
  }
}
