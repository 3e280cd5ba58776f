# Numbers of R for the tests of study/src/statistics. Run here with `Rscript reference.R`: writes ratings.csv (made up, seeded)
# and reference.csv (a name and a number a line). Written with R 4.2.2 and MASS 7.3.
library(MASS)
options(contrasts = c("contr.treatment", "contr.poly"))

set.seed(4543)
people <- 15; conditions <- c("FS", "F", "S", "phi"); surfaces <- c("cork", "silk", "tarp")
bias <- rnorm(people, 0, 0.08)
ratings <- expand.grid(condition = conditions, surface = surfaces, person = sprintf("P%02d", 1:people), stringsAsFactors = FALSE)
ratings <- ratings[, c("person", "surface", "condition")]
mu <- c(FS = 0, F = -0.16, S = -0.02, phi = -0.14)[ratings$condition] + c(cork = 0.55, silk = 0.48, tarp = 0.6)[ratings$surface]
own <- matrix(rnorm(people * 4, 0, 0.06), people)[cbind(as.integer(factor(ratings$person)), match(ratings$condition, conditions))]
noise <- rnorm(nrow(ratings), 0, c(FS = 0.08, F = 0.14, S = 0.09, phi = 0.16)[ratings$condition])
ratings$rating <- round(pmin(pmax(mu + bias[as.integer(factor(ratings$person))] + own + noise, 0), 1), 2)
write.csv(ratings, "ratings.csv", row.names = FALSE, quote = FALSE)

out <- file("reference.csv", "w")
put <- function(name, ...) {
    values <- c(...)
    if (length(values) > 1) name <- paste0(name, ".", seq_along(values) - 1)
    writeLines(sprintf("%s,%.15g", name, values), out)
}
put_aov <- function(name, table, row) {
    put(paste0(name, ".ss"), table[row, "Sum Sq"]); put(paste0(name, ".df"), table[row, "Df"])
    put(paste0(name, ".f"), table[row, "F value"]); put(paste0(name, ".p"), table[row, "Pr(>F)"])
}

d <- read.csv("ratings.csv")
d$person <- factor(d$person); d$surface <- factor(d$surface, levels = surfaces); d$condition <- factor(d$condition, levels = conditions)

# One-way between, unequal counts: the first 50 rows of cork are kept.
cork <- head(d[d$surface == "cork", ], 50)
fit <- aov(rating ~ condition, cork)
put_aov("one_way", summary(fit)[[1]], 1)
put("one_way.error_ss", summary(fit)[[1]][2, "Sum Sq"])
lambda <- function(f, a, b, level) if (pf(f, a, b) < level) 0 else uniroot(function(l) pf(f, a, b, ncp = l) - level, c(0, 500), tol = 1e-13)$root
s <- summary(fit)[[1]]
ends <- sapply(c(0.95, 0.05), function(level) lambda(s[1, "F value"], s[1, "Df"], s[2, "Df"], level))
put("one_way.eta_ends", ends / (ends + sum(s[, "Df"]) + 1))
h <- TukeyHSD(fit)$condition
put("tukey.difference", h[, "diff"]); put("tukey.low", h[, "lwr"]); put("tukey.high", h[, "upr"]); put("tukey.p", h[, "p adj"])

# Two-way between, balanced and unbalanced (every seventh row is left out): Type II.
put_two <- function(name, t, with) {
    additive <- lm(rating ~ surface + condition, t)
    full <- if (with) lm(rating ~ surface * condition, t) else additive
    ms <- deviance(full) / full$df.residual
    term <- function(n, smaller, larger) {
        df <- smaller$df.residual - larger$df.residual
        ss <- deviance(smaller) - deviance(larger)
        put(paste0(name, ".", n, ".ss"), ss); put(paste0(name, ".", n, ".f"), ss / df / ms)
        put(paste0(name, ".", n, ".p"), pf(ss / df / ms, df, full$df.residual, lower.tail = FALSE))
    }
    term("a", lm(rating ~ condition, t), additive); term("b", lm(rating ~ surface, t), additive)
    if (with) term("interaction", additive, full)
    put(paste0(name, ".error_df"), full$df.residual)
}
put_two("two_way", d, TRUE); put_two("additive", d, FALSE)
uneven <- d[-seq(1, nrow(d), 7), ]
put_two("uneven", uneven, TRUE); put_two("uneven_additive", uneven, FALSE)
put_aov("two_way.aov", summary(aov(rating ~ surface * condition, d))[[1]], 1)

# Within people: one factor (silk), two factors.
silk <- d[d$surface == "silk", ]
put_aov("within", summary(aov(rating ~ condition + Error(person / condition), silk))[["Error: person:condition"]][[1]], 1)
within_tables <- summary(aov(rating ~ surface * condition + Error(person / (surface * condition)), d))
put_aov("within.a", within_tables[["Error: person:surface"]][[1]], 1)
put_aov("within.b", within_tables[["Error: person:condition"]][[1]], 1)
put_aov("within.interaction", within_tables[["Error: person:surface:condition"]][[1]], 1)
wide <- t(sapply(split(d, d$person), function(p) p$rating[order(p$surface, p$condition)]))
cells <- expand.grid(condition = factor(conditions), surface = factor(surfaces))
spherical <- function(name, m, M, X, idata) {
    a <- anova(m, M = M, X = X, idata = idata, test = "Spherical")
    put(paste0(name, ".gg_p"), a[1, "G-G Pr"])
    put(paste0(name, ".epsilon"), stats:::sphericity(SSD(m), M = M, X = X, idata = idata)$GG.eps)
}
spherical("within", lm(wide[, 5:8] ~ 1), ~condition, ~1, data.frame(condition = factor(conditions)))
spherical("within.a", lm(wide ~ 1), ~surface, ~1, cells)
spherical("within.b", lm(wide ~ 1), ~ surface + condition, ~surface, cells)
spherical("within.interaction", lm(wide ~ 1), ~ surface * condition, ~ surface + condition, cells)

# The studentized range.
for (q in c(0.5, 2, 3.5, 4.2, 6)) for (k in c(2, 4, 10)) for (df in c(14, 42, 56, 1000))
    put(sprintf("ptukey.%g.%d.%d", q, k, df), ptukey(q, k, df))
for (k in c(3, 4, 10)) for (df in c(5, 42, 56)) put(sprintf("qtukey.%d.%d", k, df), qtukey(0.95, k, df))

# Ranks.
f <- friedman.test(wide[, 5:8]); put("friedman", f$statistic, f$p.value)
w <- wilcox.test(round(100 * (wide[, 6] - wide[, 5])), exact = FALSE); put("wilcoxon.ties", w$statistic, w$p.value)
x <- wide[, 6] - wide[, 5] + seq_len(people) / 1000 + 0.0003
w <- wilcox.test(x); put("wilcoxon.exact", w$statistic, w$p.value)
put("holm", p.adjust(c(0.01, 0.04, 0.03, 0.2, 0.005), "holm"))

# Correlation and regression on the wide table: columns 1, 2, 3 on column 4.
ct <- cor.test(wide[, 1], wide[, 4])
put("pearson", ct$estimate, ct$p.value)
put("pearson.interval", ct$conf.int)
for (with in c(TRUE, FALSE)) {
    fit <- if (with) lm(wide[, 4] ~ wide[, 1:3]) else lm(wide[, 4] ~ 0 + wide[, 1:3])
    s <- summary(fit); name <- if (with) "lm" else "lm0"
    put(paste0(name, ".b"), s$coefficients[, 1]); put(paste0(name, ".se"), s$coefficients[, 2])
    put(paste0(name, ".p"), s$coefficients[, 4])
    put(paste0(name, ".low"), confint(fit)[, 1])
    put(name, s$r.squared, s$adj.r.squared, s$fstatistic[1], pf(s$fstatistic[1], s$fstatistic[2], s$fstatistic[3], lower.tail = FALSE), s$sigma)
}

# Differences and equivalence: F less FS on silk.
x <- wide[, 6] - wide[, 5]; n <- people; t <- t.test(x)$statistic
delta <- sapply(c(0.975, 0.025), function(level) uniroot(function(l) pt(t, n - 1, l) - level, c(-15, 15), tol = 1e-13)$root)
put("dz", t / sqrt(n), delta / sqrt(n))
put("tost.low", t.test(x, mu = -0.25, alternative = "greater")$p.value)
put("tost.high", t.test(x, mu = 0.25, alternative = "less")$p.value)
put("tost.interval", t.test(x, conf.level = 0.9)$conf.int)

# Scaling: the mean ratings of the twelve cells as points of the people's three halves.
points <- t(sapply(1:10, function(i) sapply(1:3, function(j) mean(wide[(j - 1) * 5 + 1:5, i]))))
put("points", t(points))
for (k in 1:3) put(sprintf("isoMDS.%d", k), isoMDS(dist(points)^1.7 + 0.02, k = k, trace = FALSE, maxit = 500, tol = 1e-9)$stress / 100)
h <- hclust(dist(points), "ward.D2"); put("ward", h$height)

# A logistic function with the guess rate 0 and no lapses is a logistic regression.
levels <- c(1, 2, 3, 4, 5, 6); yes <- c(2, 5, 11, 15, 18, 20)
fit <- glm(cbind(yes, 20 - yes) ~ levels, family = binomial)
put("glm", coef(fit), deviance(fit), as.numeric(logLik(fit)))
close(out)
