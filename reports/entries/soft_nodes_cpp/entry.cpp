// Answers the questions by the exported C++ form of soft nodes: no Python runs where it answers. The commands are those
// of `answer.sh`; the program needs `stb_image.h`.
#include <array>
#include <chrono>
#include <cstdint>
#include <cstdio>
#include <fstream>
#include <iostream>
#include <iterator>
#include <map>
#include <sstream>
#include <string>
#include <vector>
#define STB_IMAGE_IMPLEMENTATION
#include <stb/stb_image.h>

// One thread of `evaluate`: its place in the dispatch, nothing, and the buffers in the order of the source.
extern "C" void evaluate_Thread(void* thread, void* parameters, void* buffers);

// What `evaluate` writes of a query.
struct Answer { float components[4], bounds[4]; };

class Cloth {
public:
    explicit Cloth(const std::string& folder)
        : integers(read(folder + "/tables/integers.i32")), numbers(read(folder + "/tables/numbers.f32")),
          nodes(read(folder + "/tables/nodes.f32")) {
        int width, height, channels;
        unsigned char* values = stbi_load((folder + "/tables/grid.png").c_str(), &width, &height, &channels, 1);
        grid.assign(values, values + width * height);
        stbi_image_free(values);
    }

    // u, v, deviations along both axes and their correlation, wi, wo, curvature.
    Answer evaluate(const std::array<float, 12>& query) const {
        struct Buffer { const void* data; std::size_t count; };
        Answer answer{};
        Buffer buffers[] = {{integers.data(), integers.size() / 4}, {numbers.data(), numbers.size() / 4},
                            {nodes.data(), nodes.size() / 16}, {grid.data(), grid.size() / 4},
                            {query.data(), query.size()}, {&answer, 2}};
        std::uint32_t first[6] = {};
        evaluate_Thread(first, nullptr, buffers);
        return answer;
    }

    std::size_t bytes() const { return integers.size() + numbers.size() + nodes.size() + grid.size(); }

private:
    static std::vector<char> read(const std::string& path) {
        std::ifstream file(path, std::ios::binary);
        return {std::istreambuf_iterator<char>(file), {}};
    }

    std::vector<char> integers, numbers, nodes, grid;
};

// Arguments: the folder of questions, the folder that holds a shader of each fabric, and the folder of the entry.
int main(int count, char** arguments) {
    if (count != 4) return std::fprintf(stderr, "entry QUESTIONS SHADERS ENTRY\n"), 2;
    const std::string questions = arguments[1], shaders = arguments[2], entry = arguments[3];
    std::ifstream in(questions + "/questions.csv");
    std::ofstream out(entry + "/answers.csv");
    std::map<std::string, Cloth> cloths;
    std::string line, cell;
    std::getline(in, line);
    if (line != "id,fabric,u,v,sigma,wi_x,wi_y,wi_z,wo_x,wo_y,wo_z,sigma_minor,angle,curvature")
        return std::fprintf(stderr, "other columns: %s\n", line.c_str()), 1;
    out << "id,specular_warp,specular_weft,diffuse_warp,diffuse_weft\n";
    out.precision(9);
    double nanoseconds = 0.0;
    long answered = 0;
    while (std::getline(in, line)) {
        std::vector<std::string> cells;
        for (std::stringstream stream(line); std::getline(stream, cell, ',');) cells.push_back(cell);
        const std::string &id = cells[0], &fabric = cells[1];
        std::array<float, 12> value;
        for (int n = 0; n < 12; n++) value[n] = std::stof(cells[2 + n]);
        const auto [u, v, sigma, ix, iy, iz, ox, oy, oz, minor, angle, curvature] = value;
        if (minor != sigma || curvature != 0.0f) return std::fprintf(stderr, "%s: round, flat only\n", id.c_str()), 1;
        const Cloth& cloth = cloths.try_emplace(fabric, shaders + "/" + fabric).first->second;
        const auto begin = std::chrono::steady_clock::now();
        const Answer answer = cloth.evaluate({u, v, sigma, minor, 0.0f, ix, iy, iz, ox, oy, oz, curvature});
        nanoseconds += std::chrono::duration<double, std::nano>(std::chrono::steady_clock::now() - begin).count();
        out << id;
        for (float component : answer.components) out << ',' << component;
        out << '\n';
        answered++;
    }
    std::size_t bytes = 0;
    for (const auto& [name, cloth] : cloths) bytes += cloth.bytes();
    std::printf("%ld answers, %.0f ns each, %.0f bytes for a fabric\n", answered, nanoseconds / answered,
                double(bytes) / cloths.size());
}
