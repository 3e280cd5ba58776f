// What the tests share: checks that are counted, and the graph.
#include <haptograph.h>
#include <math.h>
#include <stdint.h>
#include <stdio.h>
#include <stdlib.h>
#include <string.h>

static int failed, checks;

static void expect(int line, const char *what, int got, int wanted) {
    checks++;
    if (got == wanted) return;
    failed++;
    printf("line %d: %s: %d, not %d: %s\n", line, what, got, wanted, haptograph_last_error_message());
}

#define EXPECT(call, wanted) expect(__LINE__, #call, (int)(call), (int)(HAPTOGRAPH_STATUS_##wanted))
#define HOLDS(what) expect(__LINE__, #what, (what) ? 1 : 0, 1)

static const char *path;

static haptograph_graph open_graph(void) {
    haptograph_graph graph = {0};
    EXPECT(haptograph_graph_open(path, NULL, &graph), OK);
    HOLDS(graph.id != 0);
    return graph;
}

static int report(void) {
    printf("%d checks, %d failed\n", checks, failed);
    return failed != 0;
}
