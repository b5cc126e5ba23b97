# Writes reference.json, which tests/analysis/test_small_samples.py compares with: mixed models of lme4 with the degrees
# of freedom of lmerTest (Satterthwaite) and pbkrtest (Kenward-Roger), and bias-reduced models of brglm2 (Firth).
#
#     cd tests/data/models && Rscript reference.R
#
# Made with R 4.2.2, lme4 1.1-31, lmerTest 3.1-3, pbkrtest 0.5.2 and brglm2 0.9 of Debian 12:
# apt-get install r-base-core r-cran-lme4 r-cran-lmertest r-cran-pbkrtest r-cran-brglm2 r-cran-jsonlite
suppressMessages({library(lmerTest); library(pbkrtest); library(brglm2); library(jsonlite)})

control <- lmerControl(optimizer = "bobyqa", optCtrl = list(rhobeg = 0.2, rhoend = 1e-9, maxfun = 1e5))

mixed <- function(formula, data, contrasts = NULL) {
  fit <- suppressMessages(lmerTest::lmer(formula, data, REML = TRUE, control = control))
  k <- length(fixef(fit))
  rows <- rbind(diag(k), contrasts)
  of <- function(ddf) do.call(rbind, lapply(seq_len(nrow(rows)), function(i) {
    found <- contest1D(fit, rows[i, ], ddf = ddf)
    data.frame(estimate = found$Estimate, error = found$`Std. Error`, free = found$df, p = found$`Pr(>|t|)`)
  }))
  variances <- as.data.frame(VarCorr(fit))
  list(formula = deparse1(formula), singular = isSingular(fit), columns = unname(as.matrix(getME(fit, "X"))),
       response = unname(getME(fit, "y")), contrasts = rows,
       components = setNames(as.list(variances$vcov), paste(variances$grp, ifelse(is.na(variances$var1), "", variances$var1))),
       likelihood = as.numeric(logLik(fit)), satterthwaite = of("Satterthwaite"), kenward_roger = of("Kenward-Roger"))
}

# Studies like those of netboard: two people and their dyad, with and without forces.
study <- function(seed, dyads, trials, sd) {
  set.seed(seed)
  table <- expand.grid(trial = seq_len(trials), h = c(-0.5, 0.5), who = 1:3, dyad = seq_len(dyads))
  table$performer <- table$dyad * 10 + table$who
  table$c <- ifelse(table$who == 3, 0.5, -0.5)
  pick <- function(of, s) rnorm(max(of), 0, s)[of]
  table$y <- 1.5 - 0.1 * table$h + 0.2 * table$c - 0.1 * log(table$trial) +
    pick(table$dyad, sd[1]) + pick(table$performer, sd[2]) + table$h * (pick(table$dyad, sd[3]) + pick(table$performer, sd[4])) +
    rnorm(nrow(table), 0, 0.4)
  table
}
of_study <- function(table) {
  found <- mixed(y ~ h * c + log(trial) + (1 | dyad) + (1 | performer) + (0 + h | dyad) + (0 + h | performer), table,
                 rbind(c(0, 1, 0, 0, -0.5), c(0, 1, 0, 0, 0.5)))
  found$table <- table[c("dyad", "performer", "h", "c", "trial")]
  found
}
# The maximal structure: slopes of configuration, of the product, and of haptics in dyadic trials, which differ between dyads.
more <- function(table, seed, sd) {
  set.seed(seed)
  pick <- function(s) rnorm(max(table$dyad), 0, s)[table$dyad]
  table$hc <- table$h * table$c
  table$h2 <- table$h * (table$c > 0)
  table$y <- table$y + table$c * pick(sd[1]) + table$hc * pick(sd[2]) + table$h2 * pick(sd[3])
  table
}
of_maximal <- function(table) {
  found <- mixed(y ~ h * c + log(trial) + (1 | dyad) + (1 | performer) + (0 + h | dyad) + (0 + c | dyad) + (0 + hc | dyad) +
                   (0 + h | performer) + (0 + h2 | dyad), table, rbind(c(0, 1, 0, 0, -0.5), c(0, 1, 0, 0, 0.5)))
  found$table <- table[c("dyad", "performer", "h", "c", "trial")]
  found
}
thin <- function(table, share) { set.seed(99); table[runif(nrow(table)) < share, ] }

result <- list(
  sleepstudy = c(mixed(Reaction ~ Days + (Days || Subject), sleepstudy),
                 list(table = data.frame(group = as.integer(sleepstudy$Subject), slope = sleepstudy$Days))),
  sleepstudy_few = local({
    few <- droplevels(sleepstudy[sleepstudy$Subject %in% levels(sleepstudy$Subject)[1:4], ])
    c(mixed(Reaction ~ Days + (Days || Subject), few), list(table = data.frame(group = as.integer(few$Subject), slope = few$Days)))
  }),
  beets = c(mixed(sugpct ~ block + sow + harvest + (1 | block:harvest), beets),
            list(table = data.frame(group = as.integer(interaction(beets$block, beets$harvest))))),
  pastes = c(mixed(strength ~ 1 + (1 | batch) + (1 | sample), Pastes),
             list(table = data.frame(group = as.integer(Pastes$batch), sample = as.integer(Pastes$sample)))),
  four_dyads = of_study(study(4, 4, 6, c(0.3, 0.2, 0.3, 0.2))),
  eight_dyads = of_study(thin(study(12, 8, 6, c(0.3, 0.2, 0.3, 0.2)), 0.7)),
  singular = of_study(study(3, 4, 5, c(0.3, 0.0, 0.0, 0.0))),
  alike = of_study(study(5, 5, 4, c(0.0, 0.0, 0.0, 0.0))),
  maximal = of_maximal(more(study(21, 9, 6, c(0.3, 0.2, 0.4, 0.2)), 22, c(0.3, 0.3, 0.5))),
  maximal_few = of_maximal(thin(more(study(23, 4, 8, c(0.3, 0.2, 0.2, 0.0)), 24, c(0.4, 0.0, 0.4)), 0.8))
)

# No fall in one condition: bias-reduced (Firth) logistic and Poisson regression, trials independent.
set.seed(8)
table <- expand.grid(trial = 1:12, h = c(-0.5, 0.5), c = c(-0.5, 0.5), dyad = 1:4)
odds <- exp(-1 + 0.5 * table$h - 0.3 * table$c)
table$fell <- as.integer(runif(nrow(table)) < odds / (1 + odds))
table$fell[table$h > 0 & table$c > 0] <- 0
table$count <- rpois(nrow(table), odds)
table$count[table$h > 0 & table$c > 0] <- 0
reduced <- function(formula, family, type) {
  fit <- glm(formula, family, table, method = "brglmFit", type = type, control = list(epsilon = 1e-10, maxit = 1000))
  list(coefficients = unname(coef(fit)), errors = unname(sqrt(diag(vcov(fit)))))
}
result$firth <- list(
  table = table,
  logistic = reduced(fell ~ h * c + log(trial), binomial(), "AS_mean"),
  poisson = reduced(count ~ h * c + log(trial), poisson(), "AS_mean"),
  logistic_separated = reduced(fell ~ h * c, binomial(), "AS_mean")
)
write(toJSON(result, digits = I(10), auto_unbox = TRUE, dataframe = "columns", matrix = "rowmajor"), "reference.json")
